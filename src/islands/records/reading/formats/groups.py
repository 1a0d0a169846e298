"""Choice of a group in files that contain several tables: HDF5, MDF and TDMS."""

from collections.abc import Mapping, Sequence

from islands.errors import RecordError, join_text, name_option, suggest

#: Most groups that are listed in a message.
_LISTED = 12


def choose_group(tables: Mapping[str, bool], group: str | None, file: str) -> tuple[str, str]:
    """Return the group to read, and a sentence that names the others.

    Parameters
    ----------
    tables : mapping of str to bool
        All groups, and whether they contain a table.
    group : str or None
        The group that the user has named; by default the first with a table.

    Raises
    ------
    RecordError
        There is no such group, or no group with a table.
    """
    names = [name for name, is_table in tables.items() if is_table] or list(tables)
    if group is not None and group not in tables:
        raise RecordError(
            f"{file} has no group {group}; its groups are {_list(names)}{suggest(group, names)}"
        )
    if group is not None and not tables[group] and tables[names[0]]:
        raise RecordError(f"the group {group} of {file} has no table; groups with one are {_list(names)}")
    if not names:
        raise RecordError(f"{file} contains no channels: export the record again")
    chosen = names[0] if group is None else group
    others = [name for name in names if name != chosen]
    return (
        chosen,
        join_text(
            f"the group {chosen} of {file} is read; other groups (",
            name_option("sheet"),
            f"): {_list(others)}",
        )
        if others
        else "",
    )


def _list(names: Sequence[str]) -> str:
    more = len(names) - _LISTED
    return ", ".join(names[:_LISTED]) + (f" and {more} more" if more > 0 else "")
