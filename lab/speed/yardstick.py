"""Yardstick of times: a loop of Python that takes one second of CPU where the limits of CI were set."""

from time import process_time


def measure_yardstick(share: float = 1.0) -> float:
    """Return the seconds of CPU that the loop takes on this machine, measured over a share of it."""
    began = process_time()
    sum(i * i % 7 for i in range(int(22_000_000 * share)))
    return (process_time() - began) / share


if __name__ == "__main__":
    print(measure_yardstick())
