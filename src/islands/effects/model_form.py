"""Model-form error; `islands.simulators.narx` makes the effect of a given model."""

from islands.effects.interface.effect import EffectTemplate

#: Name of the effect.
CORE_SHAPE = "core-shape"

MODEL_FORM = EffectTemplate(
    CORE_SHAPE,
    "The model lacks terms psi |y - c u|, |psi| (y - c u) or psi(k-1), where psi is one of its regressors",
    title="wrong form of the model",
    similar_to="second-hysteresis, coulomb-friction, exponential-creep",
    distinguished_by="a loop that is too wide or too narrow wherever the input moves",
)
