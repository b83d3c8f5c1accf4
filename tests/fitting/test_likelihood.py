"""likelihood.parquet gives the likelihood back that was written, and a damaged one is refused."""

import json

import numpy as np
import polars as pl
import pytest
from tests.models.one_mass import solved, zener

from fourpole import quantities as q
from fourpole.errors import TableError
from fourpole.fitting.likelihood import (
    FILE,
    likelihood_columns,
    likelihood_in,
    likelihood_of,
    likelihood_record,
    read_likelihoods,
)
from fourpole.io.published import Published


@pytest.fixture(scope="module")
def found():
    return likelihood_of(solved(0, (zener, zener), 0.03)[0])


def table(found):
    columns = {head: values.tolist() for head, values in likelihood_columns(found).items()}
    return pl.DataFrame(columns).with_columns(pl.lit("").alias(q.RIG.head))


def test_it_is_read_as_it_was_written(found, tmp_path):
    table(found).write_parquet(tmp_path / FILE)
    record = json.loads(json.dumps({"": likelihood_record(found)}))
    again = read_likelihoods(Published(tmp_path, {"likelihood": record}))[""]
    places, given = np.arange(9), 1.01 * found.stiffness[:9]
    for one, other in zip(
        vars(found.around(places, given)).values(), vars(again.around(places, given)).values(), strict=True
    ):
        assert other == pytest.approx(one, rel=1e-9, abs=1e-12)


def test_rows_in_another_order_are_the_same(found):
    mixed = table(found).sample(fraction=1.0, shuffle=True, seed=1)
    again = likelihood_in(mixed, likelihood_record(found))
    assert again.stiffness == pytest.approx(found.stiffness, rel=1e-12)


def test_without_the_file_there_is_none(tmp_path, found):
    assert read_likelihoods(Published(tmp_path, {"likelihood": {"": likelihood_record(found)}})) == {}


@pytest.mark.parametrize("lack", [q.WEIGHTS.head, q.CONDITION.head, q.F1.parts[0]])
def test_a_table_without_a_column_is_refused(lack, tmp_path, found):
    table(found).drop(lack).write_parquet(tmp_path / FILE)
    with pytest.raises(TableError, match="run fourpole analyse again"):
        read_likelihoods(Published(tmp_path, {"likelihood": {"": likelihood_record(found)}}))


@pytest.mark.parametrize("key", ["rig", "masses", "errors", "shared"])
def test_a_record_without_a_part_is_refused(key, tmp_path, found):
    table(found).write_parquet(tmp_path / FILE)
    record = likelihood_record(found)
    del record[key]
    with pytest.raises(TableError, match=FILE):
        read_likelihoods(Published(tmp_path, {"likelihood": {"": record}}))
