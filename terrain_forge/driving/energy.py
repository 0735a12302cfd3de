"""The audit of a drive's energy: what the motors put in, and what the bodies hold."""

from __future__ import annotations

from terrain_forge.driving.result import EnergyBalance

TOLERANCE = 0.1
"""How far mechanical energy may rise above the motors' work, as a part of the energy that lifts the
rover by the radius of a wheel on Earth. A contact gives back what it stored while it was
compressed: up to 1.8 J of a rover of 50 kg whose wheels press against rocks with all their torque
(docs/driving.md), on any body. An instability makes many times that within a second."""


class EnergyAudit:
    """Follows the work of the motors and the mechanical energy.

    What the motors put in less what the bodies hold is what friction has taken, and friction gives
    nothing back: that difference may never fall, but for what contacts store.
    """

    def __init__(self, *, reference: float, energy: float) -> None:
        """Begin with the energy that lifts the rover by a wheel's radius on Earth, and its own."""
        self.limit = TOLERANCE * reference
        """Largest rise that passes [J]."""
        self._start = self._energy = energy
        self._driving = self._braking = self._taken = self._unexplained = 0.0

    def add(self, *, driving: float, braking: float, energy: float) -> None:
        """Note the work of the motors [J] since the last time, and the energy now [J]."""
        self._driving += driving
        self._braking += braking
        self._energy = energy
        taken = self._driving + self._braking - (energy - self._start)
        self._taken = max(self._taken, taken)
        self._unexplained = max(self._unexplained, self._taken - taken)

    def go_on(self, energy: float) -> None:
        """Go on in another scene, whose other bodies hold more or less energy [J]."""
        self._start += energy - self._energy
        self._energy = energy

    def fault(self) -> str:
        """What is wrong with the energy; empty if nothing is."""
        if self._unexplained <= self.limit:
            return ""
        return (
            f"energy grew without cause, by {self._unexplained:.3g} J more than the motors' work "
            f"(at most {self.limit:.3g} J)"
        )

    def balance(self) -> EnergyBalance:
        """The balance from the start until now."""
        return EnergyBalance(
            driving=self._driving,
            braking=self._braking,
            gained=self._energy - self._start,
            unexplained=self._unexplained,
        )
