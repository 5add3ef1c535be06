"""The cape keeps to what every garment has to hold to, and has its measures."""

import numpy as np
from mocapflow_cape import Cape

from mocapflow.testing import GarmentConformance, template_body


class TestCape(GarmentConformance):
    garment = Cape()
    make_body = staticmethod(template_body)  # the usual body for tests has no shoulders


def test_it_has_its_measures():
    cape = Cape(length_m=0.8, hem_m=0.7).sew(template_body())
    strands = cape.vertices[cape.strands]
    np.testing.assert_allclose(np.linalg.norm(np.diff(strands, axis=1), axis=2).sum(axis=1), 0.8)
    np.testing.assert_allclose(np.linalg.norm(strands[0, -1] - strands[-1, -1]), 0.7)


def test_it_hangs_behind_the_back():
    body = template_body()
    strands = Cape().sew(body).vertices[Cape().sew(body).strands]
    assert strands[..., 1].min() > body.positions[body.joint("chest"), 1]  # rest bodies look along -y
