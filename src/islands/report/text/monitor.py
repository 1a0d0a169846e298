"""Records and alarms of a monitor as lines of text."""

from islands.diagnosis.monitoring.change_point import ChangeForm
from islands.diagnosis.monitoring.record_follower import Alarm, AlarmKind, MonitorState


def describe_last_record(state: MonitorState) -> str:
    """Return one line on the last record: its parameters with their intervals, and the largest statistic."""
    record, reference = state.records[-1], state.reference
    assert reference is not None
    parameters = zip(reference.parameters, record.states.values, record.states.errors, strict=True)
    values = ", ".join(
        f"{each.name} {value:.5g} +/- {1.96 * error:.1g} {each.unit}".rstrip()
        for each, value, error in parameters
    )
    seen, training = state.count - state.start, state.settings.training
    is_followed = record.statistic is not None
    status = (
        f"statistic {record.statistic:.1f} of {state.threshold:.1f}"
        if is_followed
        else f"training {seen} of {training}"
    )
    parts = [values, f"noise {record.states.noise:.3g}", status]
    return f"{record.name}: {', '.join(part for part in parts if part)}"


def describe_alarm_text(state: MonitorState, alarm: Alarm) -> str:
    """Return one line on an alarm, as `describe_change`."""
    return f"ALARM: {describe_change(state, alarm)}"


def describe_change(state: MonitorState, alarm: Alarm) -> str:
    """Return an alarm in words: cause, since when, size, and causes that explain it as well."""
    is_ramp = alarm.form == ChangeForm.RAMP
    match alarm.kind:
        case AlarmKind.PARAMETER:
            change = "is drifting" if is_ramp else "changed"
            what = f"{alarm.cause} {change} from {alarm.before:.5g} to {alarm.after:.5g}{_unit(state, alarm)}"
        case AlarmKind.EFFECT:
            strength = ", ".join(
                f"{name} {value:.4g} {unit}".rstrip() for name, value, unit in alarm.strength
            )
            what = f"{alarm.cause} {'is growing' if is_ramp else 'appeared'}" + f" ({strength})" * bool(
                strength
            )
        case AlarmKind.NOISE:
            grew = "grew" if alarm.after > alarm.before else "fell"
            what = f"the noise {grew} from {alarm.before:.3g} to {alarm.after:.3g}"
        case _:
            nearest = f"; nearest: {alarm.cause}" if alarm.cause else ""
            what = f"unknown change: no parameter and no effect of the catalogue explains it{nearest}"
    since = f"since {_name(state, alarm.since)}"
    if alarm.earliest != alarm.latest:
        since += f" (95 %: {_name(state, alarm.earliest)} to {_name(state, alarm.latest)})"
    also = f"; {', '.join(alarm.equivalents[:4])} would explain it as well" if alarm.equivalents else ""
    return f"{what}, {since}{also}"


def _name(state: MonitorState, index: int) -> str:
    return state.get_record(index).name


def _unit(state: MonitorState, alarm: Alarm) -> str:
    assert state.reference is not None
    units = {each.name: each.unit for each in state.reference.parameters}
    return f" {units[alarm.cause]}" if units.get(alarm.cause) else ""
