#!/usr/bin/env python3
"""Writes the Parquet files of the tests with pyarrow.

    python3 -m venv v && v/bin/pip install pyarrow==26.0.0
    v/bin/python make.py files
"""

import sys
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

K = list(range(60))
STROKE = [50.0 + k for k in K]
PRESSURE = [None if k % 7 == 3 else 68.5 + 0.1 * k for k in K]


def table(time):
    return pa.table(
        {
            **time,
            "stroke_mm": STROKE,
            "p_A [bar]": PRESSURE,
            "motor_speed_rpm": pa.array([k - 30 for k in K], pa.int16()),
            "valve": pa.array([k > 20 for k in K]),
            "state": ["moves"] * 60,
            "cylinder": [{"oil_bar": 3.0 + k} for k in K],
            "list": [[1.0, 2.0]] * 60,
        }
    )


def main():
    folder = Path(sys.argv[1])
    folder.mkdir(exist_ok=True)
    epoch = 1_700_000_000_000_000_000
    stamps = pa.array([epoch + k * 10_000_000 for k in K], pa.timestamp("ns"))
    for name, time, options in [
        ("stamped", {"when": stamps}, {"compression": "zstd"}),
        ("seconds", {"t": [k * 0.01 for k in K]}, {"compression": "snappy"}),
        ("milliseconds", {"t_ms": pa.array([k * 10 for k in K], pa.int64())}, {"compression": "gzip"}),
    ]:
        # several groups of rows, and pages
        pq.write_table(table(time), folder / f"{name}.parquet", row_group_size=25, data_page_size=64, **options)
    pq.write_table(pa.table({"a": STROKE}), folder / "timeless.parquet")


main()
