"""Read and write single metadata fields of an open run file, and whole tables of them."""

import datetime
import functools
import math
import operator
from collections.abc import Sequence
from typing import Any

import h5py
import msgspec
import numpy as np

from app.runs.errors import DamagedRunError, MetadataError
from app.runs.schema import Field, Kind
from messages.i18n import N_

_PASSED, _FAILED = "passed", "failed"


def make_group(parent: h5py.Group, name: str, nx_class: str) -> h5py.Group:
    """Make a group of a NeXus class."""
    group = parent.create_group(name)
    group.attrs["NX_class"] = nx_class
    return group


def write_fields(group: h5py.Group, fields: Sequence[Field], value: Any, unit: str = "m") -> None:
    """Write the attributes of `value` that fields declare; readings are in `unit`. Raises MetadataError."""
    for field in fields:
        if field.attribute:
            content = operator.attrgetter(field.attribute)(value)
            _write(group, field.path, field.kind, content, field.unit.format(unit=unit))


def read_fields(group: h5py.Group, fields: Sequence[Field]) -> dict[str, Any]:
    """Read fields into nested dicts of JSON values, for `msgspec.convert`. Raises DamagedRunError."""
    raw: dict[str, Any] = {}
    for field in fields:
        if field.attribute:
            *parents, name = field.attribute.split(".")
            functools.reduce(lambda part, key: part.setdefault(key, {}), parents, raw)[name] = _read(
                group, field
            )
    return raw


def reserve_fields(file: h5py.File, fields: Sequence[Field]) -> None:
    """Make room for fields that are known at the end only. Objects made late can be lost by a crash."""
    for field in fields:
        if field.reserved_bytes:
            file.create_dataset(field.path, data=np.bytes_(b""), dtype=text_type(b"", field.reserved_bytes))
        elif field.kind is Kind.INTEGER:
            file.create_dataset(field.path, data=np.int64(field.default))
        else:
            file.create_dataset(field.path, data=math.nan if field.default is None else field.default)
            file[field.path].attrs["units"] = field.unit


def fill_fields(file: h5py.File, fields: Sequence[Field], value: Any) -> None:
    """Fill reserved fields in place; a text that is too long is cut, one that is not ASCII stored anew."""
    for field in fields:
        content = operator.attrgetter(field.attribute)(value)
        if field.reserved_bytes:
            data = encode_text(field.path, _as_text(content))[: field.reserved_bytes]
            data = data.decode("utf-8", "ignore").encode()
            kept = h5py.check_string_dtype(file[field.path].dtype)
            if not data.isascii() and kept is not None and kept.encoding == "ascii":
                del file[field.path]
                dtype = text_type(data, field.reserved_bytes)
                file.create_dataset(field.path, data=np.bytes_(data), dtype=dtype)
            else:
                file[field.path][()] = np.bytes_(data)
        else:
            file[field.path][()] = math.nan if content is None else content


def write_text(group: h5py.Group, name: str, text: str) -> None:
    """Store a text of fixed length; an empty one is left out. Raises MetadataError."""
    if text:
        data = encode_text(name, text)
        group.create_dataset(name, data=np.bytes_(data), dtype=text_type(data, len(data)))


def text_type(data: bytes, size: int) -> Any:
    """Type of a text of `size` bytes: ASCII where that holds it, as Octave's `load` reads no UTF-8."""
    return h5py.string_dtype("ascii" if data.isascii() else "utf-8", size)


def write_number(group: h5py.Group, name: str, value: float | None, units: str = "") -> None:
    """Store a number with its units; None is left out."""
    if value is not None:
        dataset = group.create_dataset(name, data=value)
        if units:
            dataset.attrs["units"] = units


def read_text(group: h5py.Group, name: str, default: str = "") -> str:
    """Read a text, `default` where there is none. Raises DamagedRunError."""
    dataset = group.get(name)
    if dataset is None:
        return default
    value = dataset[()]
    if not isinstance(value, bytes | str):
        template = N_("{file}: {path} is not a text. Restore a good copy")
        raise DamagedRunError(template, file=group.file.filename, path=f"{group.name}/{name}")
    return value if isinstance(value, str) else value.decode("utf-8", "replace")


def read_number(group: h5py.Group, name: str) -> float | None:
    """Read a number; None where it is absent or NaN. Raises DamagedRunError."""
    dataset = group.get(name)
    if dataset is None:
        return None
    value = dataset[()]
    if not isinstance(value, np.number):
        template = N_("{file}: {path} is not a number. Restore a good copy")
        raise DamagedRunError(template, file=group.file.filename, path=f"{group.name}/{name}")
    return None if np.isnan(value) else float(value)


def to_python(value: Any) -> Any:
    """Turn what h5py reads into plain Python: str, int, float, bool or list."""
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else value


def encode_text(name: str, text: str) -> bytes:
    """Bytes of a text as a run file can hold it; `name` stands in the message. Raises MetadataError."""
    try:
        data = text.encode("utf-8")
    except UnicodeEncodeError:
        raise MetadataError(
            "{name} = {text!r} is not valid Unicode. Write it again", name=name, text=text
        ) from None
    if b"\0" in data:
        raise MetadataError("{name} = {text!r} holds a zero character. Leave it out", name=name, text=text)
    return data


def _write(group: h5py.Group, path: str, kind: Kind, content: Any, unit: str) -> None:
    if kind is Kind.VECTOR:
        if content:
            group[path] = content
    elif kind in (Kind.NUMBER, Kind.INTEGER):
        write_number(group, path, content, unit)
    elif kind is Kind.JSON:
        write_text(group, path, "" if content is None else msgspec.json.encode(content).decode())
    elif kind is Kind.PASS_FAIL:
        write_text(group, path, _PASSED if content else _FAILED)
    else:
        write_text(group, path, _as_text(content))


def _read(group: h5py.Group, field: Field) -> Any:
    if field.kind is Kind.VECTOR:
        return group[field.path][()].tolist() if field.path in group else field.default
    if field.kind in (Kind.NUMBER, Kind.INTEGER):
        number = read_number(group, field.path)
        if number is None:
            return field.default
        return int(number) if field.kind is Kind.INTEGER else number
    text = read_text(group, field.path)
    if field.kind is Kind.PASS_FAIL:
        return text == _PASSED
    if field.kind is Kind.JSON and text:
        return msgspec.json.decode(text)
    if field.kind is Kind.DATE and text:
        datetime.datetime.fromisoformat(text)  # its ValueError names the text, that of msgspec does not
    return text or field.default


def _as_text(content: str | datetime.date | None) -> str:
    return content.isoformat() if isinstance(content, datetime.date) else content or ""
