"""Datasets for LeRobot from recorded runs: ``python -m dsm.lerobot export RUN.mcap... --out DIR``.

>>> from dsm.lerobot import check_dataset, export_runs  # doctest: +SKIP
>>> export_runs(["run.mcap"], "dataset")  # doctest: +SKIP
>>> check_dataset("dataset").findings  # doctest: +SKIP
[]

The format is LeRobotDataset v3.0, Parquet tables and MP4 videos. Needs the extra ``dsm[lerobot]``, but not LeRobot
itself. See ``docs/datasets.md``.
"""

from dsm.lerobot.check import Dataset, check_dataset
from dsm.lerobot.export import export_runs
from dsm.lerobot.layout import DatasetError
from dsm.lerobot.writer import DatasetWriter, Episode, Shape

__all__ = ["Dataset", "DatasetError", "DatasetWriter", "Episode", "Shape", "check_dataset", "export_runs"]
