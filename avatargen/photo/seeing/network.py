"""A network of a .tflite file, run on a processor."""

from pathlib import Path
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float32

from avatargen.extras import require_extra


@runtime_checkable
class Network(Protocol):
    """Pictures to numbers."""

    def __call__(self, picture: Float32[np.ndarray, "H W 3"]) -> list[np.ndarray]: ...


class FileNetwork:
    """The network of a file. Raises InputError where its runtime is not installed."""

    def __init__(self, path: Path) -> None:
        require_extra("ai_edge_litert")
        from ai_edge_litert.interpreter import (  # pyright: ignore[reportMissingImports]
            Interpreter,
            OpResolverType,
        )

        # its delegate is faster, and says so on standard error
        plain = OpResolverType.BUILTIN_WITHOUT_DEFAULT_DELEGATES
        self.interpreter = Interpreter(str(path), num_threads=1, experimental_op_resolver_type=plain)
        self.interpreter.allocate_tensors()
        self.input = self.interpreter.get_input_details()[0]["index"]
        self.outputs = [each["index"] for each in self.interpreter.get_output_details()]

    def __call__(self, picture: Float32[np.ndarray, "H W 3"]) -> list[np.ndarray]:
        """All outputs, for one picture."""
        self.interpreter.set_tensor(self.input, picture[None].astype(np.float32))
        self.interpreter.invoke()
        return [self.interpreter.get_tensor(index) for index in self.outputs]
