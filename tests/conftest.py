"""Shared by every test: shape hints are checked at run time, torch keeps to two threads.

The import hook must be in place before any of our packages is imported, so it stands above everything else.
"""

from jaxtyping import install_import_hook

hook = install_import_hook(["avatargen", "assets", "exporters"], "beartype.beartype")

import torch  # noqa: E402 (the hook comes first)

torch.set_num_threads(2)
