"""Several garments as one: their numbers, and their names."""

from dataclasses import replace

import numpy as np
import pytest

from mocapflow.geometry.outfits import pinned_anew, together
from mocapflow.geometry.sewing import sheet
from mocapflow.testing.bodies import tiny_body, tiny_garment

BODY = tiny_body()
LONG = tiny_garment(BODY)
SHORT = replace(
    sheet("band", BODY, np.random.default_rng(1).uniform(size=(5, 3, 3)), closed=False, repairs=("too tight",)),
    carried_by=np.ones(15, np.int32),
)


@pytest.mark.parametrize("first, second", [(LONG, SHORT), (SHORT, LONG)])
def test_each_piece_has_its_own_vertices(first, second):
    both, count = together("both", [first, second]), len(first.vertices)
    for name in ("faces", "rings", "pinned"):
        one, other = np.split(getattr(both, name), [len(getattr(first, name))])
        np.testing.assert_array_equal(one, getattr(first, name))
        np.testing.assert_array_equal(other, getattr(second, name) + count)
    for name in ("vertices", "ring_length", "carried_by", "pinned_to", "parameter_bounds"):
        np.testing.assert_array_equal(getattr(both, name), np.concatenate([getattr(g, name) for g in (first, second)]))


@pytest.mark.parametrize("first, second", [(LONG, SHORT), (SHORT, LONG)])
def test_shorter_strands_are_padded(first, second):
    strands = together("both", [first, second]).strands
    found = [row[row >= 0].tolist() for row in strands]
    assert found == [*first.strands.tolist(), *(second.strands + len(first.vertices)).tolist()]
    assert strands.shape == (21, 8) and (np.diff((strands >= 0).astype(int), axis=1) <= 0).all()


def test_parameters_and_repairs_are_named_after_their_piece():
    both = together("both", [LONG, SHORT])
    assert both.parameter_names == (
        "tube.thickness_m", "tube.wind_cos_rad", "tube.wind_sin_rad", "band.thickness_m"
    )  # fmt: skip
    assert both.columns("thickness_m") == [0, 3] and both.columns("wind_cos_rad", "wind_sin_rad") == [1, 2]
    assert LONG.columns("thickness_m") == [0]
    assert both.repairs == ("band: too tight",)


def test_pieces_of_one_name_are_numbered():
    both = together("both", [SHORT, LONG, SHORT])
    assert both.parameter_names[0] == "band_1.thickness_m" and both.parameter_names[-1] == "band_2.thickness_m"
    assert both.repairs == ("band_1: too tight", "band_2: too tight")


def test_an_outfit_within_an_outfit_is_its_pieces():
    inner = together("inner", [LONG, SHORT])
    outer = together("outer", [inner, SHORT])
    assert [piece.name for piece in outer.pieces] == ["tube", "band", "band"]
    assert outer.parameter_names[-1] == "band_2.thickness_m"


def test_every_piece_is_pinned_anew():
    order = np.random.default_rng(2).permutation(len(BODY.vertices))
    other = replace(BODY, vertices=BODY.vertices[order], faces=np.argsort(order)[BODY.faces].astype(np.int32))
    moved = pinned_anew(together("both", [LONG, SHORT]), BODY, other)
    np.testing.assert_array_equal(
        other.vertices[moved.pinned_to], BODY.vertices[together("b", [LONG, SHORT]).pinned_to]
    )
    np.testing.assert_array_equal(np.concatenate([piece.pinned_to for piece in moved.pieces]), moved.pinned_to)
