"""Linear state space: what a linearisation hands over to the analysis and the design of a controller.

The definitions are those of Astrom and Wittenmark, Computer-Controlled Systems, 3rd ed., Prentice Hall 1997,
chapters 2 and 3.
"""

from cmath import log
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from math import comb, isnan, log10, perm, pi
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from islands.distribution import describe_missing_extra
from islands.errors import ModelError, SettingsError
from islands.rounding import ROUNDING

if TYPE_CHECKING:
    import control

#: Points of a frequency response whose frequencies are not given; their lowest one relative to the slowest
#: mode, and to the highest one at least and at most.
_POINTS, _BELOW, _LEAST, _MOST = 600, 0.1, 1e-5, 0.03

#: Highest frequency of a continuous system relative to its fastest mode.
_ABOVE = 10.0

#: Fewest and most samples of a step response whose length is not given, and the part of its slowest mode that
#: remains at its end.
_FEWEST, _LONGEST, _SETTLED = 64, 65_536, 1e-3

#: Names of the gains of one integrator, to the slope of an output, and of two, to its curvature.
INTEGRATOR_GAINS = "integrator gain", "double integrator gain"

#: Points of the circle on which these are computed.
_CIRCLE = 64

#: Conversions between discrete and continuous systems.
METHODS = ("zoh", "tustin")


@dataclass(frozen=True, slots=True, eq=False)
class LinearResponse:
    """Response of a linear system from every input to every output.

    Attributes
    ----------
    points : ndarray, shape (points,)
        Frequencies in hertz (cycles per sample without a sampling time), or times in seconds.
    values : ndarray, shape (outputs, inputs, points)
        Complex for frequencies; NaN at the frequency of an undamped mode.
    members : ndarray, shape (members, outputs, inputs, points)
        Responses of the models that the data do not exclude; empty if they are not known.
    weights : ndarray, shape (members,)
    """

    points: NDArray[np.float64]
    values: NDArray[Any]
    members: NDArray[Any]
    weights: NDArray[np.float64]

    def band(
        self,
        level: float = 0.9,
        of: Callable[[NDArray[Any]], NDArray[np.float64]] = np.abs,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return limits that contain a part of the weight of the members, each of the shape of ``values``.

        Parameters
        ----------
        level : float
            Part of the weight, between 0 and 1.
        of : callable
            Real quantity of a response: its magnitude by default; `numpy.real` of a step response.

        Raises
        ------
        ModelError
            The uncertainty of the system is not known.
        """
        if not len(self.members):
            raise ModelError(
                "the uncertainty of this system is not known: linearise a result, or a model that was loaded "
                "from its folder or file"
            )
        return measure_band(of(self.members), self.weights, level)


def measure_band(
    members: NDArray[np.float64], weights: NDArray[np.float64], level: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the weighted quantiles of members, shape (members, ...), that enclose a part of the weight."""
    if not 0.0 < level < 1.0:
        raise SettingsError(f"the level of a band is between 0 and 1, got {level}")
    tails = 0.5 * (1.0 - level), 0.5 * (1.0 + level)
    low, high = np.quantile(members, tails, axis=0, weights=weights, method="inverted_cdf")
    return low, high


@dataclass(frozen=True, slots=True, eq=False, repr=False, kw_only=True)
class StateSpace:
    """Linear system x(k+1) = A x(k) + B u(k - d), y(k) = C x(k) + D u(k - d), or dx/dt = A x + B u(t - d).

    Its signals are deviations from the operating point.

    Attributes
    ----------
    A : ndarray, shape (states, states)
    B : ndarray, shape (states, inputs)
    C : ndarray, shape (outputs, states)
    D : ndarray, shape (outputs, inputs)
    dt : float or None
        Sampling time in seconds; 0 of a continuous system, None if unspecified. Times are then in samples.
    input_names, output_names, input_units, output_units : tuple of str
        Empty for a system without names; a unit is empty if it is unknown.
    dead_times : tuple of float
        Delay d of every input in seconds; whole samples of a discrete system. Empty for none.
    operating_inputs, operating_outputs : tuple of float
        Operating point in the units of the record; empty if unknown.
    members : tuple of StateSpace
        Linearisations of the models that the data do not exclude; empty if they are not known. Bands come
        from them.
    weights : tuple of float
        Weights of the members, which sum to 1.
    """

    A: NDArray[np.float64]
    B: NDArray[np.float64]
    C: NDArray[np.float64]
    D: NDArray[np.float64]
    dt: float | None = None
    input_names: tuple[str, ...] = ()
    output_names: tuple[str, ...] = ()
    input_units: tuple[str, ...] = ()
    output_units: tuple[str, ...] = ()
    dead_times: tuple[float, ...] = ()
    operating_inputs: tuple[float, ...] = ()
    operating_outputs: tuple[float, ...] = ()
    members: "tuple[StateSpace, ...]" = ()
    weights: tuple[float, ...] = ()

    def __repr__(self) -> str:
        kind = "continuous" if self.is_continuous else "discrete"
        outputs, inputs = self.D.shape
        return f"<{kind} StateSpace of order {self.order}: {inputs} inputs, {outputs} outputs>"

    @property
    def order(self) -> int:
        """Number of states."""
        return len(self.A)

    @property
    def is_static(self) -> bool:
        """Whether the outputs depend on the inputs of the same time only."""
        return not (self.order or any(self.dead_times))

    @property
    def is_continuous(self) -> bool:
        """Whether the system is a differential equation."""
        return self.dt == 0.0

    @property
    def step(self) -> float:
        """Sampling time, 1 if it is unspecified."""
        return 1.0 if self.dt is None else self.dt

    @property
    def delays(self) -> NDArray[np.float64]:
        """Dead time of every input, shape (inputs,)."""
        return np.array(self.dead_times or (0.0,) * self.D.shape[1])

    @property
    def poles(self) -> NDArray[np.complex128]:
        """Poles, the eigenvalues of A; a dead time has none."""
        return np.linalg.eigvals(self.A).astype(np.complex128)

    @property
    def zeros(self) -> NDArray[np.complex128]:
        """Invariant zeros of a system with as many outputs as inputs, without those at infinity.

        Raises
        ------
        ModelError
            The numbers of inputs and outputs differ; take those of one input and output (`select`).
        """
        from scipy.linalg import eig  # noqa: PLC0415 - a twentieth of a second, for this property alone

        outputs, inputs = self.D.shape
        if outputs != inputs:
            raise ModelError(
                f"the system has {inputs} inputs and {outputs} outputs: take the zeros of one of each, by "
                "select(output, input)"
            )
        pencil = np.block([[self.A, self.B], [self.C, self.D]])
        mask = np.zeros_like(pencil)
        mask[: self.order, : self.order] = np.eye(self.order)
        alpha, beta = eig(pencil, mask, right=False, homogeneous_eigvals=True)
        finite = np.abs(beta) > ROUNDING**0.5 * np.abs(alpha)
        return np.sort_complex(alpha[finite] / beta[finite])

    @property
    def rates(self) -> NDArray[np.complex128]:
        """Poles of the continuous system in radians per second; minus infinity of a pole of zero."""
        if self.is_continuous:
            return self.poles
        with np.errstate(divide="ignore"):
            growth = np.log(np.abs(self.poles))
        # A complex division would turn minus infinity into NaN.
        return np.asarray(growth / self.step + 1j * (np.angle(self.poles) / self.step), np.complex128)

    @property
    def natural_frequencies(self) -> NDArray[np.float64]:
        """Natural frequency of every pole in hertz, in the order of `poles`."""
        return np.abs(self.rates) / (2.0 * pi)

    @property
    def damping(self) -> NDArray[np.float64]:
        """Damping ratio of every pole, in the order of `poles`; NaN of an integrator, 1 of a delay."""
        rates = self.rates
        with np.errstate(invalid="ignore"):
            found = -rates.real / np.abs(rates)
        return np.where(np.isinf(rates.real), 1.0, found)

    @property
    def is_stable(self) -> bool:
        """Whether all poles are stable."""
        poles = self.poles
        return bool((poles.real < 0.0).all() if self.is_continuous else (np.abs(poles) < 1.0).all())

    @property
    def static_gain(self) -> NDArray[np.float64]:
        """Outputs at rest for a unit of every input, shape (outputs, inputs); NaN for an integrator."""
        try:
            states = np.linalg.solve(-self._subtract_identity(), self.B)
        except np.linalg.LinAlgError:
            return np.full(self.D.shape, np.nan)
        return np.array([row @ states for row in self.C]) + self.D

    def _subtract_identity(self) -> NDArray[np.float64]:
        return self.A if self.is_continuous else self.A - np.eye(self.order)

    def select(self, output: int = 0, input: int = 0) -> "StateSpace":  # noqa: A002 - as in python-control
        """Return the system of one input and one output, by their numbers from 0."""
        rows, columns = slice(output, output + 1), slice(input, input + 1)
        return replace(
            self,
            B=self.B[:, columns],
            C=self.C[rows],
            D=self.D[rows, columns],
            **{name: getattr(self, name)[columns] for name in _OF_INPUTS},
            **{name: getattr(self, name)[rows] for name in _OF_OUTPUTS},
            members=tuple(each.select(output, input) for each in self.members),
        )

    def respond(self, frequencies: ArrayLike) -> NDArray[np.complex128]:
        """Return the frequency response, shape (outputs, inputs, points).

        Parameters
        ----------
        frequencies : array_like, shape (points,)
            In hertz; without a sampling time in cycles per sample, 0.5 is the Nyquist frequency.
        """
        points = np.atleast_1d(np.asarray(frequencies, dtype=np.float64))
        s = 2j * pi * points
        z = s if self.is_continuous else np.exp(s * self.step)
        try:
            states = np.linalg.solve(z[:, None, None] * np.eye(self.order) - self.A, self.B[None])
        except np.linalg.LinAlgError:
            # One of the points is an undamped mode.
            if len(points) == 1:
                return np.full((*self.D.shape, 1), np.nan, np.complex128)
            return np.concatenate([self.respond(half) for half in np.array_split(points, 2)], axis=-1)
        found = (self.C @ states + self.D) * np.exp(-s[:, None, None] * self.delays)
        return np.moveaxis(found, 0, -1)

    def frequency_response(self, frequencies: ArrayLike | None = None) -> LinearResponse:
        """Return the frequency response with the responses of the members.

        Parameters
        ----------
        frequencies : array_like, shape (points,), optional
            As of `respond`; by default from below the slowest mode to the Nyquist frequency.
        """
        points = (
            self._list_frequencies()
            if frequencies is None
            else np.atleast_1d(np.asarray(frequencies, dtype=np.float64))
        )
        return self._collect(points, lambda each: each.respond(points))

    def _collect(
        self, points: NDArray[np.float64], respond: "Callable[[StateSpace], NDArray[Any]]"
    ) -> LinearResponse:
        values = respond(self)
        members = [respond(each) for each in self.members]
        found = np.array(members) if members else np.empty((0, *values.shape))
        return LinearResponse(points, values, found, np.array(self.weights))

    def _list_frequencies(self) -> NDArray[np.float64]:
        """Return frequencies from below the slowest mode to the highest one, those of resonances too."""
        moving = self.natural_frequencies
        moving = moving[np.isfinite(moving) & (moving > 0.0)]
        last = _ABOVE * float(moving.max(initial=1.0)) if self.is_continuous else 0.5 / self.step
        slowest = float(moving.min()) if moving.size else last
        first = min(max(_BELOW * slowest, _LEAST * last), _MOST * last)
        resonances = self.natural_frequencies[self.poles.imag > 0.0]
        spaced = np.geomspace(first, last, _POINTS)
        spaced[-1] = last
        return np.unique(np.concatenate([spaced, resonances[(resonances > first) & (resonances < last)]]))

    def step_response(self, samples: int | None = None) -> LinearResponse:
        """Return the outputs, as deviations, after a unit step of every input at the time 0.

        Parameters
        ----------
        samples : int, optional
            By default until the slowest mode has settled to a thousandth, 64 to 65 536.

        Raises
        ------
        SettingsError
            There is less than one sample, or the system is continuous; convert it with `to_discrete`.
        """
        if self.is_continuous:
            raise SettingsError("the step response needs a sampling time: take to_discrete(dt) before")
        if samples is not None and samples < 1:
            raise SettingsError(f"a response has at least 1 sample, got {samples}")
        count = self._count_samples() if samples is None else samples
        return self._collect(
            self.step * np.arange(count, dtype=np.float64), lambda each: each._respond_to_step(count)
        )

    def _respond_to_step(self, count: int) -> NDArray[np.float64]:
        y = np.zeros((*self.D.shape, count))
        for channel, delay in enumerate(np.rint(self.delays / self.step).astype(int)):
            # The state and the constant input at sample k, from those of the first half by a power of the
            # transition.
            transition = self._hold_inputs(self.A, self.B[:, [channel]], np.eye(1))
            signals = np.eye(1 + self.order)[:, -1:]
            while signals.shape[1] < count - delay:
                signals = np.hstack([signals, transition @ signals])
                transition = transition @ transition
            y[:, channel, delay:] = (np.hstack([self.C, self.D[:, [channel]]]) @ signals)[:, : count - delay]
        return y

    def _count_samples(self) -> int:
        slowest = float(np.abs(self.poles).max(initial=0.0))
        delay = int(self.delays.max(initial=0.0) / self.step)
        if not 0.0 < slowest < 1.0:
            return _FEWEST + delay
        return min(_LONGEST, max(_FEWEST, round(log10(_SETTLED) / log10(slowest))) + delay)

    def to_continuous(self, method: str = "zoh") -> "StateSpace":
        """Return the continuous system.

        Parameters
        ----------
        method : str
            ``zoh``: the system whose samples are these for inputs that are constant between them; ``tustin``:
            s = 2 (z - 1) / (dt (z + 1)), for inputs that are not.

        Raises
        ------
        ModelError
            There is no sampling time, or a pole has no continuous counterpart: with ``zoh`` one of zero or a
            negative one, with ``tustin`` one of -1.
        """
        if self.is_continuous:
            return self
        if self.dt is None:
            raise ModelError("a continuous system needs the sampling time of the model: set its dt")
        _check_method(method)
        poles, order = self.poles, self.order
        size = max(1.0, float(np.abs(poles).max(initial=0.0)))
        if method == "tustin":
            if (np.abs(poles + 1.0) <= ROUNDING**0.5).any():
                raise ModelError(
                    "the system has a pole of -1, which no continuous system has by Tustin's rule"
                )
            inverse = np.linalg.inv(self.A + np.eye(order))
            return self._with_matrices(
                2.0 / self.dt * inverse @ (self.A - np.eye(order)),
                2.0 / self.dt**0.5 * inverse @ self.B,
                2.0 / self.dt**0.5 * self.C @ inverse,
                self.D - self.C @ inverse @ self.B,
                *(0.0, method),
            )
        bad = poles[(np.abs(poles.imag) <= ROUNDING**0.5 * size) & (poles.real <= ROUNDING**0.5 * size)]
        if bad.size:
            raise ModelError(
                f"the pole {bad[0].real:.3g} has no continuous counterpart for inputs that are held: it is a "
                "delay or alternates from sample to sample. Hand over the discrete system, or convert by "
                "Tustin's rule (tustin)"
            )
        from scipy.linalg import logm  # noqa: PLC0415 - a twentieth of a second, for this conversion alone

        held = np.real(logm(self._hold_inputs(self.A, self.B, np.eye(self.D.shape[1])))) / self.dt
        return self._with_matrices(held[:order, :order], held[:order, order:], self.C, self.D, 0.0, method)

    def to_discrete(self, dt: float, method: str = "zoh") -> "StateSpace":
        """Return the discrete system of a continuous one; the inverse of `to_continuous`.

        Raises
        ------
        ModelError
            The system is discrete.
        SettingsError
            The sampling time is not positive, or a dead time is no multiple of it.
        """
        if not self.is_continuous:
            raise ModelError("the system is discrete: take to_continuous() before")
        if not dt > 0.0:
            raise SettingsError(f"a sampling time is positive, got {dt}")
        _check_method(method)
        counts = self.delays / dt
        if (np.abs(counts - np.rint(counts)) > 1e-6 * np.maximum(1.0, counts)).any():
            raise SettingsError(f"the dead times {self.dead_times} s are no multiples of {dt} s")
        order, inputs = self.B.shape
        if method == "tustin":
            inverse = np.linalg.inv(np.eye(order) - 0.5 * dt * self.A)
            return self._with_matrices(
                inverse @ (np.eye(order) + 0.5 * dt * self.A),
                dt**0.5 * inverse @ self.B,
                dt**0.5 * self.C @ inverse,
                self.D + 0.5 * dt * self.C @ inverse @ self.B,
                *(dt, method),
            )
        from scipy.linalg import expm  # noqa: PLC0415 - as above

        held = expm(dt * self._hold_inputs(self.A, self.B, np.zeros((inputs, inputs))))
        return self._with_matrices(held[:order, :order], held[:order, order:], self.C, self.D, dt, method)

    @staticmethod
    def _hold_inputs(
        A: NDArray[np.float64], B: NDArray[np.float64], corner: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        return np.block([[A, B], [np.zeros((B.shape[1], len(A))), corner]])

    def _with_matrices(
        self,
        A: NDArray[np.float64],
        B: NDArray[np.float64],
        C: NDArray[np.float64],
        D: NDArray[np.float64],
        dt: float,
        method: str,
    ) -> "StateSpace":
        """Return the system at another sampling time, with the members that can be converted."""
        members, weights = [], []
        for each, weight in zip(self.members, self.weights, strict=True):
            try:
                members.append(each.to_discrete(dt, method) if dt else each.to_continuous(method))
            except ModelError:
                continue
            weights.append(weight)
        kept = tuple(weight / sum(weights) for weight in weights)
        return replace(self, A=A, B=B, C=C, D=D, dt=dt, members=tuple(members), weights=kept)

    def expand_delays(self, pade: int | None = None) -> "StateSpace":
        """Return the system with its dead times as states.

        Parameters
        ----------
        pade : int, optional
            States of each dead time of a continuous system: the order of its Pade approximation, whose
            magnitude is 1. That of order 4 has the phase to a degree up to ``0.7 / dead time`` hertz.

        Raises
        ------
        ModelError
            The system is continuous and has a dead time, and no order is given.
        """
        if not self.delays.any():
            return self
        if self.is_continuous:
            return self._approximate_delays(pade)
        counts = np.rint(self.delays / self.step).astype(int)
        system, total = self, int(counts.sum())
        order, inputs = self.B.shape
        A, B = np.zeros((order + total,) * 2), np.zeros((order + total, inputs))
        C, D = np.hstack([system.C, np.zeros((len(self.C), total))]), self.D.copy()
        A[:order, :order] = self.A
        first = order
        for channel, count in enumerate(counts):
            if not count:
                B[:order, channel] = self.B[:, channel]
                continue
            # A shift register: its last place is the delayed input.
            last = first + count - 1
            A[range(first + 1, last + 1), range(first, last)] = 1.0
            A[:order, last], C[:, last] = self.B[:, channel], self.D[:, channel]
            B[first, channel], D[:, channel] = 1.0, 0.0
            first = last + 1
        members = tuple(each.expand_delays() for each in self.members)
        return replace(self, A=A, B=B, C=C, D=D, dead_times=(), members=members)

    def _approximate_delays(self, count: int | None) -> "StateSpace":
        if count is None or count < 1:
            raise ModelError(
                "a dead time has no finite number of states in continuous time: take the discrete system, or "
                "state the order of a Pade approximation, as pade=4"
            )
        # Coefficients of the powers of s * dead time, the highest one first: Golub and Van Loan, Matrix
        # Computations, 4th ed., 2013, section 9.3.1.
        powers = np.arange(count, -1, -1)
        weights = np.array([comb(count, k) / perm(2 * count, k) for k in powers])
        late = [place for place, delay in enumerate(self.delays) if delay]
        order, total = self.order, count * len(late)
        A, B = np.zeros((order + total,) * 2), np.zeros((order + total, self.D.shape[1]))
        C, D = np.hstack([self.C, np.zeros((len(self.C), total))]), self.D.copy()
        A[:order, :order], B[:order] = self.A, self.B
        for first, place in zip(range(order, order + total, count), late, strict=True):
            # N(s) / N(-s) = (-1)^count + a strictly proper rest, in the controllable form of unit dead time.
            own, direct = slice(first, first + count), (-1.0) ** count
            ahead = weights * (-1.0) ** powers
            rest = ((ahead - direct * weights) / weights[0])[1:]
            A[own, own] = np.eye(count, k=-1) / self.delays[place]
            A[first, own] = -weights[1:] / weights[0] / self.delays[place]
            A[:order, own] = np.outer(self.B[:, place], rest)
            C[:, own] = np.outer(self.D[:, place], rest)
            B[:order, place], D[:, place] = direct * self.B[:, place], direct * self.D[:, place]
            B[first, place] = 1.0 / self.delays[place]
        members = tuple(each.expand_delays(count) for each in self.members)
        return replace(self, A=A, B=B, C=C, D=D, dead_times=(), members=members)

    def transfer_functions(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return numerators, shape (outputs, inputs, order + 1), and the common denominator, (order + 1,).

        Coefficients of z, or of s, begin with the highest power; dead times are not part of them.
        """
        denominator = np.real(np.poly(self.poles)) if self.order else np.ones(1)
        numerators = np.empty((*self.D.shape, self.order + 1))
        for output, row in enumerate(self.C):
            for channel, column in enumerate(self.B.T):
                # det(zI - A + b c) = det(zI - A) (1 + c (zI - A)^-1 b).
                closed = np.linalg.eigvals(self.A - np.outer(column, row)) if self.order else np.empty(0)
                direct = self.D[output, channel]
                numerators[output, channel] = np.real(np.poly(closed)) + (direct - 1.0) * denominator
        return numerators, denominator

    def to_control(
        self, form: str = "state-space", *, pade: int | None = None
    ) -> "control.StateSpace | control.TransferFunction":
        """Return the system as one of the library python-control (extra ``control``).

        A discrete system stays discrete; ``to_continuous().to_control()`` is the continuous one.

        Parameters
        ----------
        form : str
            ``state-space`` or ``transfer-function``.
        pade : int, optional
            As of `expand_delays`: dead times become states, since python-control has none.

        Raises
        ------
        ModelError
            python-control is not installed, or the system is continuous and has a dead time without ``pade``.
        SettingsError
            The form is unknown.
        """
        if form not in FORMS:
            raise SettingsError(f"there is no form {form!r}: take {' or '.join(FORMS)}")
        try:
            import control as library  # noqa: PLC0415 - an extra
        except ImportError as error:
            raise ModelError(describe_missing_extra("a linear system", "control")) from error
        system = self.expand_delays(pade)
        names: dict[str, Any] = {"inputs": list(self.input_names) or None}
        names["outputs"] = list(self.output_names) or None
        dt = True if self.dt is None else self.dt
        if form == FORMS[0]:
            return library.ss(system.A, system.B, system.C, system.D, dt, **names)
        numerators, denominator = system.transfer_functions()
        return library.tf(
            [[np.trim_zeros(each, "f") if each.any() else [0.0] for each in row] for row in numerators],
            [[denominator] * self.D.shape[1]] * len(self.C),
            *(dt,),
            **names,
        )

    def describe_point(self) -> str:
        """Return the operating point as text: ``u_V = 0.1``."""
        pairs = zip(self.input_names, self.operating_inputs, strict=False)
        return ", ".join(f"{name} = {value:.4g}" for name, value in pairs) or "its operating point"

    def describe(self) -> tuple[str, ...]:
        """State time constants and resonances, dead times and static gains.

        Several outputs may have the same modes, each with states of its own: they are stated once.
        """
        modes: Iterable[str] = () if self.dt is None else describe_poles(self.poles, self.dt)
        if len(self.output_names) > 1:
            modes = dict.fromkeys(modes)
        late = [
            f"dead time of {name} {delay:.4g} s"
            for name, delay in zip(self.input_names, self.dead_times, strict=False)
            if delay
        ]
        gains = [
            f"static gain of {name} {gain:.4g}{f' on {output}' if len(self.output_names) > 1 else ''}"
            for output, row in zip(self.output_names, self.static_gain, strict=True)
            for name, gain in zip(self.input_names, row, strict=True)
            if np.isfinite(gain)
        ]
        return (*modes, *late, *gains)

    @property
    def quantities(self) -> "tuple[Quantity, ...]":
        """Quantities of the modes, slowest first, and the gains and dead times of the first output.

        Empty without a time.
        """
        return self.list_quantities(list_modes(self.poles))

    def list_quantities(self, modes: Iterable[complex]) -> "tuple[Quantity, ...]":
        """Return the quantities with the modes in a given order."""
        if not self.dt:
            return ()
        of_modes = (each for pole in modes for each in measure_mode(pole, self.step))
        return (*of_modes, *_measure_gains(self), *_measure_dead_times(self))


#: Forms of a system in which it is handed over.
FORMS = ("state-space", "transfer-function")

#: Attributes with an entry for each input, and for each output.
_OF_INPUTS = ("input_names", "input_units", "dead_times", "operating_inputs")
_OF_OUTPUTS = ("output_names", "output_units", "operating_outputs")


def _check_method(method: str) -> None:
    if method not in METHODS:
        raise SettingsError(f"there is no conversion {method!r}: take {' or '.join(METHODS)}")


def find_resonances(poles: Iterable[complex], dt: float) -> list[tuple[float, float]]:
    """Return the frequency in hertz and the damping ratio of every pair of complex poles, slowest first.

    A sampling time of 0 is that of poles in continuous time.
    """
    rates = [log(pole) / dt if dt else pole for pole in poles if pole.imag > 0.0]
    return sorted((abs(rate) / (2.0 * pi), -rate.real / abs(rate)) for rate in rates)


@dataclass(frozen=True, slots=True)
class Quantity:
    """A property of a linear system that does not depend on the coordinates of the states.

    Attributes
    ----------
    name : str
        ``time constant``, ``frequency``, ``damping ratio``, ``pole``, ``static gain``, ``integrator gain``,
        ``double integrator gain`` or ``dead time``.
    value : float
    unit : str
        ``s`` or ``Hz``; empty for a number, and for a gain, whose unit is that of the output by that of the
        input.
    input : int or None
        Number of the input of a gain, from 1.
    """

    name: str
    value: float
    unit: str = ""
    input: int | None = None


def list_modes(poles: Iterable[complex], is_continuous: bool = False) -> list[complex]:
    """Return the real poles, and of each pair of complex ones that above the real axis, slowest first."""
    ordered = sorted(
        map(complex, poles), key=lambda each: (-each.real if is_continuous else -abs(each), -each.imag)
    )
    return [pole for pole in ordered if pole.imag >= 0.0]


def measure_mode(pole: complex, dt: float) -> tuple[Quantity, ...]:
    """Return the quantities of a mode: a time constant, or frequency and damping ratio; none of a delay.

    A sampling time of 0 is that of a pole in continuous time.
    """
    if _is_delay(pole, dt):
        return ()
    if pole.imag > 0.0:
        ((frequency, damping),) = find_resonances([pole], dt)
        return Quantity("frequency", frequency, "Hz"), Quantity("damping ratio", damping)
    if not (0.0 < pole.real < 1.0 if dt else pole.real < 0.0):
        return (Quantity("pole", pole.real),)
    return (Quantity("time constant", -dt / log(pole).real if dt else -1.0 / pole.real, "s"),)


def _is_delay(pole: complex, dt: float) -> bool:
    return bool(dt) and not pole


def _measure_gains(system: StateSpace) -> Iterable[Quantity]:
    """Yield the gain of every input to the first output, of integrators that to its slope or curvature."""
    distances = np.sort(np.abs(system.poles - 1.0))
    # Two equal poles differ by the root of a rounding error.
    found = [count for count in (1, 2) if (distances[count - 1 : count] ** count <= ROUNDING).any()]
    if not found:
        for number, gain in enumerate(system.static_gain[0].tolist(), start=1):
            yield Quantity("static gain", gain, input=number)
        return
    # (z - 1)^count G(z) has no pole at 1, so that its value there is its mean over a circle around.
    count, radius = found[-1], 0.5 * distances[found[-1] :].min(initial=1.0)
    offsets = radius * np.exp(2j * np.pi * (np.arange(_CIRCLE) + 0.5) / _CIRCLE)
    matrices = (1.0 + offsets)[:, None, None] * np.eye(system.order) - system.A
    values = np.linalg.solve(matrices, np.broadcast_to(system.B, (_CIRCLE, *system.B.shape)))
    gains = np.real(offsets**count @ (system.C[0] @ values)) / (_CIRCLE * system.step**count)
    for number, gain in enumerate(gains.tolist(), start=1):
        yield Quantity(INTEGRATOR_GAINS[count - 1], gain, input=number)


def _measure_dead_times(system: StateSpace) -> Iterable[Quantity]:
    """Yield the dead times of the inputs that have one."""
    for number, delay in enumerate(system.dead_times, start=1):
        if delay:
            yield Quantity("dead time", delay, "s", number)


def describe_poles(
    poles: Iterable[complex], dt: float, errors: Sequence[float] | None = None
) -> tuple[str, ...]:
    """State the time constants and resonances of poles, slowest first.

    Parameters
    ----------
    poles : iterable of complex
    dt : float
        Sampling time in seconds; 0 of poles in continuous time.
    errors : sequence of float, optional
        Standard errors of the quantities of all modes, one mode after the other.
    """
    texts, left = [], list(errors or ())
    for pole in list_modes(poles, is_continuous=not dt):
        quantities = measure_mode(pole, dt)
        own, left = left[: len(quantities)], left[len(quantities) :]
        texts.append(_describe_pole(pole, dt, [write_error(each) for each in own] or [""] * 2))
    return tuple(texts)


def write_error(error: float) -> str:
    """Write a standard error after its value; nothing if it is NaN."""
    return "" if isnan(error) else f" +- {error:.2g}"


def _describe_pole(pole: complex, dt: float, errors: Sequence[str]) -> str:
    if _is_delay(pole, dt):
        return "a delay of one sample"
    first, *others = measure_mode(pole, dt)
    if others:
        frequency = f"{first.value:.4g}{errors[0]} Hz"
        return f"resonance at {frequency} with a damping ratio of {others[0].value:.3g}{errors[1]}"
    if first.name == "time constant":
        return f"time constant {first.value:.4g}{errors[0]} s"
    if dt and pole.real < 0.0:
        return f"an alternating mode (pole {pole.real:.4g}{errors[0]})"
    return f"a mode that does not decay (pole {pole.real:.6g}{errors[0]})"
