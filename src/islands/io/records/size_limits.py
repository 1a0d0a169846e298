"""What a file claims to hold is held against what it stores, before any memory is taken for it."""

from islands.errors import RecordError

#: Samples of a column, 1 GiB in double precision. Nobody identifies from more, and a few bytes can claim it.
MOST_SAMPLES = 2**27

#: Bytes that one byte of deflate can stand for at most: https://zlib.net/zlib_tech.html.
DENSEST = 1032


def check_samples(samples: int, column: str, file: str) -> None:
    """Refuse a column that claims more samples than any record has.

    Raises
    ------
    RecordError
        There are more than `MOST_SAMPLES`.
    """
    if samples > MOST_SAMPLES:
        raise RecordError(
            f"{file}: column {column} claims {samples} samples, and a record has {MOST_SAMPLES} at most: "
            "if it really is as long, write a part of it to a file of its own; otherwise the file is damaged"
        )


def check_stored(claimed: int, stored: int, deflated: bool, column: str, file: str) -> None:
    """Refuse a column that claims more bytes than those that are stored for it can hold.

    Parameters
    ----------
    claimed, stored : int
        Bytes of the values, and bytes in the file.
    deflated : bool
        Whether the stored bytes are packed by deflate.
    column, file : str
        For the message.

    Raises
    ------
    RecordError
        The claim cannot be true.
    """
    if claimed > stored * (DENSEST if deflated else 1):
        raise RecordError(
            f"{file}: column {column} claims {claimed} bytes, and the file stores {stored} for it"
            f"{', packed' if deflated else ''}: it is damaged or cut short, write it anew"
        )
