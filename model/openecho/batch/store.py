"""Finished blocks of a job that may be interrupted: files in a folder beside its result."""

from __future__ import annotations

import fcntl
import json
import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np


class StoreError(RuntimeError):
    """Blocks of another job, or blocks that can't be read: one line with what was found and what was expected."""


@dataclass(frozen=True)
class Store:
    """Folder of a job's finished blocks.

    Attributes
    ----------
    folder : Path
        It bears the result's name and ``.partial``, so that nobody takes it for the result.
    result : Path
        Where the job's result is to be.
    """

    folder: Path
    result: Path

    def finished(self) -> set[int]:
        """Numbers of the blocks that are complete."""
        return {int(path.stem) for path in self.folder.glob("[0-9]*.npz")}

    def put(self, number: int, **arrays: np.ndarray) -> None:
        """Keep the arrays of a block, complete or not at all."""
        path = self._path(number)
        partial = path.with_suffix(".new")
        with written(partial):
            with partial.open("wb") as file:
                np.savez(file, **arrays)  # type: ignore[arg-type, unused-ignore]
            partial.replace(path)

    def get(self, number: int, name: str) -> np.ndarray:
        """One array of a finished block.

        Raises
        ------
        StoreError
            If it can't be read.
        """
        path = self._path(number)
        try:
            with np.load(path) as arrays:
                kept: np.ndarray = arrays[name]
        except Exception as error:  # numpy and zipfile raise nearly anything on a damaged file
            raise StoreError(f"{path}: {error}, expected a block; without this file it is made anew") from error
        return kept

    def finish(self, made: Path) -> None:
        """Put the complete result in its place, and remove the blocks."""
        made.replace(self.result)
        shutil.rmtree(self.folder)

    def _path(self, number: int) -> Path:
        return self.folder / f"{number:06}.npz"


@contextmanager
def written(path: Path) -> Iterator[None]:
    """Name the file in an error of writing it, which a full disk alone does not, and leave nothing of it."""
    try:
        yield
    except OSError as error:
        path.unlink(missing_ok=True)
        error.filename = error.filename or str(path)
        raise


@contextmanager
def open_store(result: Path, job: dict[str, Any]) -> Iterator[Store]:
    """Make or find again the folder of a job's blocks; it stays if the job breaks off with some, and goes when it ends.

    Parameters
    ----------
    result : Path
        Where the job's result is to be.
    job : dict
        Everything that its blocks depend on, JSON types.

    Raises
    ------
    StoreError
        If the folder has blocks of a job that differs, or belongs to one that runs now.
    """
    folder = result.with_name(f"{result.name}.partial")
    folder.mkdir(exist_ok=True)
    lock = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise StoreError(f"{folder}: found another process at work on it, expected none") from error
        _claim(folder, json.loads(json.dumps(job)))
        store = Store(folder, result)
        try:
            yield store
        except BaseException:
            if not store.finished():
                shutil.rmtree(folder)
            raise
    finally:
        os.close(lock)


def _claim(folder: Path, job: dict[str, Any]) -> None:
    """Write down whose blocks these are, or compare."""
    description = folder / "job.json"
    if not description.exists():
        partial = folder / "job.new"
        partial.write_text(json.dumps(job, indent=1) + "\n")
        partial.replace(description)
        return
    try:
        found = json.loads(description.read_text())
        differing = [name for name in job if found[name] != job[name]]
    except (ValueError, KeyError, TypeError) as error:
        raise StoreError(f"{description}: not readable, expected the description of a job; remove {folder}") from error
    if differing:
        name = differing[0]
        raise StoreError(
            f"{folder}: found blocks of a job with {name} {found[name]}, expected {job[name]}: "
            "give the options of that job to go on, or remove the folder"
        )
