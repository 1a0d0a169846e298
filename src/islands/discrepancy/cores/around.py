"""What stands around a core, and declares what that declares."""

from islands.discrepancy.core import Core
from islands.discrepancy.effect import Effect, Site
from islands.discrepancy.parameter import Parameter
from islands.discrepancy.scene import Frame, Scene, Signal


class Around:
    """A core around another one; what it does not say itself, that one says."""

    __slots__ = ()

    core: Core

    @property
    def name(self) -> str:
        """As the core's."""
        return self.core.name

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """As the core's."""
        return self.core.parameters

    @property
    def sites(self) -> frozenset[Site]:
        """As the core's."""
        return self.core.sites

    @property
    def understood(self) -> frozenset[str]:
        """As the core's."""
        return self.core.understood

    @property
    def has(self) -> frozenset[str]:
        """As the core's."""
        return self.core.has

    @property
    def effects(self) -> tuple[Effect, ...]:
        """As the core's."""
        return self.core.effects

    @property
    def integrates(self) -> bool:
        """As the core's."""
        return self.core.integrates

    def frame(self, scene: Scene, output: Signal) -> Frame:
        """See `islands.discrepancy.core.Core`."""
        return self.core.frame(scene, output)
