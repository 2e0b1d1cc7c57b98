"""Masks and annotations in COCO format."""

from collections.abc import Mapping, Sequence
from itertools import groupby
from typing import Any

import numpy as np
from numpy.typing import NDArray


def encode_mask(mask: NDArray[np.bool_]) -> dict[str, Any]:
    """A mask as uncompressed run lengths, column by column; the first run is of pixels that are not set."""
    flat = mask.ravel(order="F").tolist()
    runs = [len(list(group)) for _, group in groupby(flat)]
    return {"counts": [0] * bool(flat[0]) + runs, "size": list(mask.shape)}


def decode_mask(encoded: Mapping[str, Any]) -> NDArray[np.bool_]:
    """The mask of uncompressed run lengths, the inverse of `encode_mask`."""
    counts = np.array(encoded["counts"])
    flat = np.repeat(np.arange(len(counts)) % 2 == 1, counts)
    return flat.reshape(encoded["size"], order="F")


def make_coco(detections: Sequence[Mapping[str, Any]], size: tuple[int, int]) -> dict[str, Any]:
    """The annotations of the images of one scene.

    Args:
        detections: As in the BOP benchmark, with `image_id`, `category_id`, `bbox` and `segmentation`.
        size: Width and height of the images, [pixels].
    """
    width, height = size
    return {
        "images": [
            {"id": image, "file_name": f"rgb/{image:06d}.png", "width": width, "height": height}
            for image in sorted({each["image_id"] for each in detections})
        ],
        "annotations": [
            {
                "id": k,
                **{name: each[name] for name in ("image_id", "category_id", "bbox", "segmentation")},
                "area": sum(each["segmentation"]["counts"][1::2]),
                "iscrowd": 0,
                "ignore": False,
            }
            for k, each in enumerate(detections, start=1)
        ],
        "categories": [
            {"id": number, "name": str(number), "supercategory": "part"}
            for number in sorted({each["category_id"] for each in detections})
        ],
    }
