#!/usr/bin/env python3
"""Writes the MDF files of the tests with asammdf, and beside each what asammdf reads from it.

    python3 -m venv v && v/bin/pip install asammdf==8.8.28
    v/bin/python make.py files

conversions.csv is of conversions.mf4, parts.csv of parts.mf4, crane.csv of all others; a line for each sample: channel, unit, time in s, value (empty where it is
invalid). The files are made anew only when what they shall show changes: they hold the time of writing.
"""

import sys
from pathlib import Path

import numpy as np
from asammdf import MDF, Signal

FAST = np.arange(60) * 0.01
SLOW = np.arange(12) * 0.05 + 0.002


def signal(name, samples, unit, time=FAST, **more):
    return Signal(np.asarray(samples), time, name=name, unit=unit, **more)


def crane():
    """Two groups with a time each, numbers of several types, a linear conversion, a device behind a name."""
    k = np.arange(60)
    mdf = MDF(version="4.10")
    mdf.append(
        [
            signal("stroke", 50.0 + k, "mm"),
            signal("motor_speed\\ETKC:1", (k - 30).astype(np.int16), "rpm"),
            signal("holding_valve", (k > 20).astype(np.uint8), ""),
            signal("p_A", (k * 3).astype(np.uint16), "bar", conversion={"a": 0.1, "b": 60.0}),
        ],
        acq_name="100 Hz",
    )
    mdf.append([signal("oil", np.linspace(40, 41, 12).astype(np.float32), "degC", SLOW)], acq_name="20 Hz")
    return mdf


def conversions():
    """Conversions, states, invalid samples, big endian, a text, and an array. (Ranges are not here: of whole numbers, asammdf 8.8.28 finds only the upper end.)"""
    k = np.arange(60)
    mdf = MDF(version="4.10")
    rational = {f"P{n}": v for n, v in zip(range(1, 7), [0, 2.0, 3.0, 0, 0, 4.0])}
    table = {"raw_0": 0, "phys_0": 0.0, "raw_1": 20, "phys_1": 10.0, "raw_2": 59, "phys_2": -5.0}
    states = {"val_0": 0, "text_0": "closed", "val_1": 1, "text_1": "open"}
    mdf.append(
        [
            signal("rational", k.astype(np.uint8), "bar", conversion=rational),
            signal("interpolated", k.astype(np.int32), "mm", conversion={**table, "interpolation": True}),
            signal("stepped", k.astype(np.int64), "mm", conversion={**table, "interpolation": False}),
            signal("state", (k % 2).astype(np.uint8), "", conversion=states),
            signal("invalid", k * 0.5, "bar", invalidation_bits=(k % 7 == 3)),
            signal("big_endian", k.astype(">f4"), "mm"),
            signal("text", np.array([b"word"] * 60), "", encoding="utf-8"),
            signal("array", np.rec.fromarrays([np.arange(180.0).reshape(60, 3)], dtype=[("array", "<f8", (3,))]), "bar"),
        ],
        acq_name="all",
    )
    return mdf


def parts():
    """Ranges and values of which some are converted and others are texts, as busses have them (not available, an error)."""
    k = np.arange(60)
    mdf = MDF(version="4.10")
    error = {"lower_1": 64256, "upper_1": 65535, "text_1": "error"}
    ranges = {"lower_0": 0, "upper_0": 64255, "text_0": {"a": 0.125, "b": 0.0}, **error}
    # of real numbers, 10 is in the second range and 20 in none
    real = {"lower_0": 0.0, "upper_0": 10.0, "text_0": "error", "lower_1": 10.0, "upper_1": 20.0, "text_1": {"a": 2.0, "b": 0.0}}
    values = {"val_0": 0, "text_0": "closed", "val_1": 1, "text_1": {"a": 3.0, "b": 0.5}, "val_2": 255, "text_2": "error"}
    mdf.append(
        [
            signal("ranges", (k * 1100).astype(np.uint16), "rpm", conversion=ranges),
            signal("real", k * 0.5, "bar", conversion=real),
            signal("values", (k % 3).astype(np.uint8), "mm", conversion=values),
        ],
        acq_name="all",
    )
    return mdf


def read_back(path):
    """What asammdf reads: a line for each sample."""
    lines = []
    with MDF(path) as mdf:
        for group, channels in enumerate(mdf.groups):
            for index, channel in enumerate(channels.channels):
                if channel.name in ("time", "text") or channel.name.startswith("array"):
                    continue
                raw = channel.name == "state"
                found = mdf.get(group=group, index=index, raw=raw, ignore_invalidation_bits=True)
                bits = found.invalidation_bits
                invalid = [False] * len(found.samples) if bits is None else np.asarray(bits)
                for time, value, bad in zip(found.timestamps, found.samples, invalid):
                    number = "" if bad else repr(float(value))
                    lines.append(f"{channel.name},{found.unit},{float(time)!r},{number}")
    return "\n".join(lines) + "\n"


def write(folder, name, mdf, compression):
    path = folder / f"{name}.mf4"
    mdf.save(path, compression=compression, overwrite=True)
    return read_back(path)


def main():
    folder = Path(sys.argv[1])
    folder.mkdir(exist_ok=True)
    expected = write(folder, "plain", crane(), 0)
    (folder / "crane.csv").write_text(expected)
    assert expected == write(folder, "deflate", crane(), 1)
    assert expected == write(folder, "transposed", crane(), 2)
    for name, compression in [("zstd", 3), ("transposed_lz4", 6)]:
        assert expected == write(folder, name, crane().convert("4.30"), compression)
    # lists of blocks: the smallest pieces that asammdf writes
    for name, compression in [("list", 0), ("packed_list", 2)]:
        pieces = crane()
        pieces.configure(write_fragment_size=100)
        assert expected == write(folder, name, pieces, compression)
    (folder / "conversions.csv").write_text(write(folder, "conversions", conversions(), 2))
    (folder / "parts.csv").write_text(write(folder, "parts", parts(), 2))


main()
