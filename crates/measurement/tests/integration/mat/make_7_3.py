#!/usr/bin/env python3
"""Writes the MAT files of level 7.3 (HDF5) of the tests with h5py, laid out as MATLAB does: arrays with reversed dimensions and MATLAB_class, structures as groups,
arrays of structures as references into #refs#.

    python3 -m venv v && v/bin/pip install h5py==3.16.0
    v/bin/python make_7_3.py files
"""

import sys
from pathlib import Path

import h5py
import numpy as np

K = np.arange(50)
T, X, P = K * 0.01, 50.0 + K, 68.5 + 0.1 * K


def array(group, name, values, matlab="double", **more):
    """A matrix as MATLAB has it (rows, columns), stored the other way round."""
    data = group.create_dataset(name, data=np.asarray(values).T, **more)
    data.attrs["MATLAB_class"] = np.bytes_(matlab)
    return data


def text(group, name, characters):
    codes = np.array([[ord(c) for c in characters]], dtype=np.uint16)
    data = array(group, name, codes, "char")
    data.attrs["MATLAB_int_decode"] = np.int32(2)
    return data


def structure(group, name):
    made = group.create_group(name)
    made.attrs["MATLAB_class"] = np.bytes_("struct")
    return made


def structures(file, group, name, elements):
    """An array of structures: for each field a dataset of references."""
    made, refs = structure(group, name), file.require_group("#refs#")
    for field in elements[0]:
        links = []
        for element in elements:
            place = f"r{len(refs)}"
            value = element[field]
            (text if isinstance(value, str) else array)(refs, place, value)
            links.append(refs[place].ref)
        made.create_dataset(field, data=np.array([links], dtype=object).T, dtype=h5py.ref_dtype)


def finish(path):
    """Writes what MATLAB writes before the HDF5 file."""
    head = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    with open(path, "r+b") as file:
        file.write(head)


def file(folder, name):
    return h5py.File(folder / f"{name}.mat", "w", userblock_size=512, libver="earliest")


def main():
    folder = Path(sys.argv[1])
    folder.mkdir(exist_ok=True)
    with file(folder, "arrays_7_3") as made:
        array(made, "t", T[None, :])
        array(made, "stroke_mm", X[None, :].astype(np.int32), "int32", chunks=(25, 1), compression="gzip")
        array(made, "pressures_bar", np.stack([P, P - 60]), chunks=(25, 2), compression="gzip", shuffle=True)
        array(made, "single_bar", P[:, None].astype(np.float32), "single")
        inner = structure(made, "log")
        array(inner, "time", T[:10, None] * 5)
        array(inner, "oil_bar", np.full((10, 1), 3.0))
        cell = made.create_dataset("names", data=np.array([[made["t"].ref]], dtype=object), dtype=h5py.ref_dtype)
        cell.attrs["MATLAB_class"] = np.bytes_("cell")
        array(made, "out", np.zeros((1, 6), dtype=np.uint32), "timeseries")
    with file(folder, "scope_7_3") as made:
        scope = structure(made, "ScopeData")
        array(scope, "time", T[:, None])
        signals = [{"values": X[:, None], "label": "stroke_mm"}, {"values": P[:, None], "label": "p_A [bar]"}]
        structures(made, scope, "signals", signals)
    with file(folder, "groups_7_3") as made:
        array(made, "t", T[None, :])
        array(made, "stroke_mm", X[None, :])
        sparse = made.create_group("sparse")
        sparse.attrs["MATLAB_class"] = np.bytes_("double")
        sparse.attrs["MATLAB_sparse"] = np.uint64(50)
        sparse.create_dataset("data", data=X)
        sparse.create_dataset("ir", data=np.arange(50, dtype=np.uint64))
        sparse.create_dataset("jc", data=np.array([0, 50], dtype=np.uint64))
        handle = made.create_group("handle")
        handle.attrs["MATLAB_class"] = np.bytes_("function_handle")
        array(handle.create_group("function_handle"), "function", X[None, :])
    for path in folder.glob("*_7_3.mat"):
        finish(path)


main()
