"""Table 2 of the paper: every choice as a change of a run's settings."""

from dataclasses import replace

from avatargen.training.adversarial_config import AdversarialConfig


def choices(base: AdversarialConfig) -> dict[str, AdversarialConfig]:
    """The rows of the table; the first is what the paper settles on."""

    def geometry(**change: str) -> AdversarialConfig:
        return replace(base, geometry=replace(base.geometry, **change))

    def render(**change: int) -> AdversarialConfig:
        return replace(base, render=replace(base.render, **change))

    return {
        "as the paper": base,
        "density": geometry(representation="density"),
        "residual deformation only": geometry(deformation="residual"),
        "inverse skinning only": geometry(deformation="inverse_skinning"),
        **{f"K = {nearest}": render(nearest=nearest) for nearest in (2, 3, 4)},
        **{f"{samples} ray steps": render(samples=samples) for samples in (12, 24, 36, 48)},
        "observed body prior": geometry(prior="observed"),
        "no body prior": geometry(prior="none", distance="raw"),
        "raw distance": geometry(distance="raw"),
        "without SMPL loss": replace(base, losses=replace(base.losses, smpl=0.0)),
    }
