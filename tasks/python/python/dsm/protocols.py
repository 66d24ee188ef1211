"""What objects of your own must do to take the place of a built-in part.

Any class with these methods will do; there is nothing to inherit from.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from dsm._dsm import Detection, Frame


class Detector(Protocol):
    """Finds things in pictures: open-vocabulary detection and segmentation.

    An attribute ``name`` (text) is kept with the votes in the map; without it the class's name is. What ``detect``
    raises ends the run and is raised again by the call that runs it.
    """

    def detect(self, frame: Frame) -> Iterable[Detection]:
        """Masks, names and scores of what is visible. Called on a thread of its own, one frame after the other."""
        ...


class Reader(Protocol):
    """Reads words. One kind of :data:`Language`."""

    def read(self, text: str, object_names: Sequence[str]) -> Sequence[dict[str, Any]]:
        """Readings of the words, likeliest first, as ``query`` of a :class:`dsm.types.Grounding` has them.

        They are held to what was said; an exception leaves the words to the embedded grammar.
        """
        ...


class Scorer(Protocol):
    """Scores relations of candidates. One kind of :data:`Language`."""

    def score(self, text: str, query: dict[str, Any], candidates: Sequence[dict[str, Any]]) -> Sequence[float]:
        """How well each candidate's relations fit, 0 to 1.

        A candidate has ``id``, ``name``, ``relations`` as pairs of kind and name, and the embedded ``score``.
        """
        ...


class Verifier(Protocol):
    """Looks at the few best candidates. One kind of :data:`Language`."""

    def verify(
        self, text: str, query: dict[str, Any], candidates: Sequence[dict[str, Any]]
    ) -> Sequence[tuple[float, str]]:
        """For each candidate a factor, 0 to 1, and what was seen, in words.

        A candidate has ``id``, ``name``, ``anchors`` and the pictures ``object``, ``place`` and ``scene`` as arrays
        (height, width, 3), rendered from the map.
        """
        ...


Language = Reader | Scorer | Verifier
"""A language backend: an object with one or more of ``read``, ``score`` and ``verify``."""


class Driver(Protocol):
    """A robot of your own. Times are seconds from the run's start; what is raised ends the run.

    An attribute ``waits_for_work`` that is true says that time stands still while the program thinks, as in a world
    that is stepped. Commands give what was really sent, or None when it was just that.
    """

    def now_s(self) -> float:
        """The present moment; reading it lets no time pass."""
        ...

    def wait_until(self, time_s: float) -> None:
        """Lets time pass until then: a world steps, hardware waits."""
        ...

    def command_base(self, forward_m_per_s: float, turn_rad_per_s: float) -> tuple[float, float] | None:
        """Commands the base until the next command; a base that hears nothing for 0.5 s must stop."""
        ...

    def base_velocity(self) -> tuple[float, float]:
        """Measured forward speed and turning rate."""
        ...

    def command_joints(self, group: str, velocities: NDArray[np.float64]) -> Sequence[float] | None:
        """Commands the joints of ``arm`` or ``head``, in the order of ``robot.toml``."""
        ...

    def joint_state(self, group: str) -> tuple[Sequence[float], Sequence[float]]:
        """Measured positions and velocities of ``arm`` or ``head``."""
        ...

    def command_gripper(self, width_m: float, force_n: float) -> tuple[float, float] | None:
        """Moves the fingers to a width with at most that force."""
        ...

    def gripper_state(self) -> tuple[float, float, bool]:
        """Free width in metres, force in newtons, and whether the fingers move."""
        ...

    def cameras(self) -> Sequence[str]:
        """Names of the cameras, as in ``robot.toml``."""
        ...

    def read_camera(self, camera: str) -> Frame | None:
        """The newest picture that was not read yet."""
        ...

    def world_from_base(self) -> NDArray[np.float64]:
        """Where the robot believes it is, (4, 4); it may jump."""
        ...

    def odom_from_base(self) -> NDArray[np.float64]:
        """Smooth pose that drifts, (4, 4)."""
        ...

    def stop(self, reason: str) -> None:
        """Stops all motion now and stays stopped."""
        ...

    def reset(self) -> None:
        """Lets the robot move again after a stop."""
        ...
