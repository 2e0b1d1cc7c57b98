"""Masks and annotations in COCO format."""

from __future__ import annotations

from typing import Any

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from apo_bench.formats.coco import decode_mask, encode_mask, make_coco


@given(arrays(np.bool_, array_shapes(min_dims=2, max_dims=2, max_side=12), elements=st.booleans()))
def test_masks_come_back(mask: Any) -> None:
    encoded = encode_mask(mask)
    assert np.array_equal(decode_mask(encoded), mask)
    assert sum(encoded["counts"]) == mask.size
    assert all(encoded["counts"][1:])


def test_run_lengths_go_down_the_columns() -> None:
    assert encode_mask(np.array([[0, 1], [1, 1]], dtype=np.bool_)) == {"counts": [1, 3], "size": [2, 2]}
    assert encode_mask(np.array([[1, 0], [1, 0]], dtype=np.bool_)) == {"counts": [0, 2, 2], "size": [2, 2]}


def test_annotations_count_the_pixels_of_their_masks() -> None:
    mask = np.zeros((4, 6), dtype=np.bool_)
    mask[1:3, 2:5] = True
    detection = {"image_id": 7, "category_id": 3, "bbox": [2, 1, 3, 2], "segmentation": encode_mask(mask)}
    made = make_coco([detection, {**detection, "image_id": 8}], (6, 4))
    assert [each["id"] for each in made["images"]] == [7, 8]
    assert [(each["id"], each["area"]) for each in made["annotations"]] == [(1, 6), (2, 6)]
    assert [each["id"] for each in made["categories"]] == [3]
