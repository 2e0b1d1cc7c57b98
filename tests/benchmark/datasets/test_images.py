"""Data sets of images: what is in the files, that they agree with each other, secrets, and interrupted runs."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import imageio.v3 as imageio
import numpy as np
import pytest
import trimesh
from msgspec.structs import replace

from apo_bench import InputError, TrialConfig, load_scenario
from apo_bench.benchmark.datasets.images import make as made
from apo_bench.benchmark.datasets.images.estimate import estimate_images
from apo_bench.benchmark.datasets.images.models import ImageObject, make_info_entry, make_model, measure_diameter
from apo_bench.benchmark.datasets.images.scene import add_depth_noise, disturb_mask
from apo_bench.benchmark.datasets.images.views import draw_views
from apo_bench.benchmark.scoring.pose_errors import measure_recall
from apo_bench.formats.bop import read_results
from apo_bench.formats.bop_images import ImageConfig, read_cameras, read_image_description
from apo_bench.formats.bop_models import read_symmetries
from apo_bench.formats.coco import decode_mask
from apo_bench.geometry import collect_corners, pose, shrink_pieces
from apo_bench.io import convert_typed
from apo_bench.records import SecretSeed
from tests.image_sets import SMALL, list_truth, make, write_truth


@pytest.fixture(scope="module")
def images(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make(tmp_path_factory.mktemp("images") / "set", config=replace(SMALL, cameras=2))


def read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def test_every_file_of_the_format_is_there(images: Path) -> None:
    scene = images / "test" / "000001"
    names = {path.relative_to(images).as_posix() for path in images.rglob("*") if path.is_file()}
    assert {f"models/obj_{k:06d}.ply" for k in (1, 2, 3)} <= names
    assert {f"models_eval/obj_{k:06d}.ply" for k in (1, 2, 3)} <= names
    assert {"camera.json", "test_targets_bop19.json", "detections.json", "README.md"} <= names
    ids = [1, 2, 3, 1001, 1002, 1003]
    assert sorted(path.stem for path in (scene / "depth").iterdir()) == [f"{k:06d}" for k in ids]
    for name in ("scene_camera.json", "scene_gt.json", "scene_gt_info.json"):
        assert sorted(map(int, read(scene / name))) == ids
    assert len([*(scene / "mask").iterdir()]) == len([*(scene / "mask_visib").iterdir()]) == 3 * len(ids)
    assert not (scene / "rgb").exists()  # SMALL has no colours


def measure_distance(triangles: Any, point: Any) -> float:
    """The distance of a point, (3,), from triangles, (n, 3, 3)."""
    nearest = trimesh.triangles.closest_point(triangles, np.tile(point, (len(triangles), 1)))
    return float(np.linalg.norm(nearest - point, axis=1).min())


def test_depth_points_lie_on_the_models_at_the_true_poses(images: Path) -> None:
    """Masks, depth, camera, poses and models of every image agree to the step of the depth image."""
    scene = images / "test" / "000001"
    cameras = read_cameras(scene)
    truth = read(scene / "scene_gt.json")
    models = {k: trimesh.load(images / "models" / f"obj_{k:06d}.ply", process=False) for k in (1, 2, 3)}
    for image, camera in cameras.items():
        depth = camera.depth_scale * imageio.imread(scene / "depth" / f"{image:06d}.png").astype(float)
        for k, entry in enumerate(truth[str(image)]):
            v, u = np.nonzero(imageio.imread(scene / "mask_visib" / f"{image:06d}_{k:06d}.png"))
            points = depth[v, u, None] * (np.column_stack([u, v, np.ones(len(u))]) @ np.linalg.inv(camera.K).T)
            T = pose.rigid(np.reshape(entry["cam_R_m2c"], (3, 3)), entry["cam_t_m2c"])
            local = pose.apply(pose.inverse(T), points)
            some = local[:: max(1, len(local) // 20)]
            nearest = [measure_distance(models[entry["obj_id"]].triangles, p) for p in some]
            assert max(nearest, default=0.0) < 0.06  # half a step, and a slanted ray


def test_published_cameras_give_world_poses(images: Path) -> None:
    """Both cameras agree on where the parts are, and the end is what the demonstration left."""
    description = read_image_description(images)
    cameras = read_cameras(images / "test" / "000001")
    world = {
        (image, number): cameras[image].T_world_camera @ T @ pose.inverse(description.offset(number))
        for (_, image, number), T in list_truth(images)
    }
    for (image, number), T in world.items():
        assert np.allclose(T, world[image % 1000, number], atol=1e-9)
    scene = description.scenes["1"]
    assert scene.images["1002"].operation == 2
    assert world[3, scene.parts["castle2"]][2, 3] == pytest.approx(0.08, abs=2e-3)


def test_detections_targets_and_coco_agree_with_the_masks(images: Path) -> None:
    scene = images / "test" / "000001"
    facts, truth = read(scene / "scene_gt_info.json"), read(scene / "scene_gt.json")
    masks = {
        (int(image), entry["obj_id"]): imageio.imread(scene / "mask_visib" / f"{int(image):06d}_{k:06d}.png") > 0
        for image, entries in truth.items()
        for k, entry in enumerate(entries)
        if facts[image][k]["visib_fract"] >= 0.1
    }
    detections = read(images / "detections.json")
    assert len(detections) == len(masks)
    for each in detections:
        mask = masks[each["image_id"], each["category_id"]]
        assert np.array_equal(decode_mask(each["segmentation"]), mask)
        v, u = np.nonzero(mask)
        assert each["bbox"] == [u.min(), v.min(), np.ptp(u) + 1, np.ptp(v) + 1]
    targets = read(images / "test_targets_bop19.json")
    assert {(each["im_id"], each["obj_id"]): each["inst_count"] for each in targets} == dict.fromkeys(masks, 1)
    coco = read(scene / "scene_gt_coco.json")
    assert [each["area"] for each in coco["annotations"]] == [
        masks[each["image_id"], each["category_id"]].sum() for each in detections
    ]


@pytest.mark.parametrize("name", ["stick_in_tower", "peg_in_hole"])
def test_models_are_centred_and_symmetries_leave_them_where_they_are(name: str, tmp_path: Path) -> None:
    for part, solid in load_scenario(name).assembly.solids.items():
        if part == "table":
            continue
        each = ImageObject("file", 0.25, (0.5, 0.25, 1.0), solid)
        mesh = make_model(each)
        entry = make_info_entry(each, mesh.vertices)
        low = np.array([entry[f"min_{axis}"] for axis in "xyz"])
        size = np.array([entry[f"size_{axis}"] for axis in "xyz"])
        assert low == pytest.approx(-size / 2, abs=1e-9)
        corners = 1e3 * collect_corners(shrink_pieces(solid, 0.25e-3))[0]
        assert entry["diameter"] == pytest.approx(measure_diameter(corners), rel=1e-9)
        assert (mesh.visual.vertex_colors == [128, 64, 255, 255]).all()
        path = tmp_path / "models_info.json"
        path.write_text(json.dumps({"1": entry}), encoding="utf-8")
        known = read_symmetries(path)
        for g in known[1].images[:: max(1, len(known[1].images) // 12)] if 1 in known else ():
            # a round part is a prism, whose turned corners lie on the same circles
            turned = pose.apply(g, mesh.vertices)
            assert np.abs(turned.min(axis=0) - low).max() < 0.02 * entry["diameter"]
            assert np.abs(turned.max(axis=0) + low).max() < 0.02 * entry["diameter"]


def test_equal_parts_are_one_object_also_in_several_scenarios() -> None:
    names = ("stick_in_tower", "stick_on_castles", "gearbox")
    loaded = {name: load_scenario(name) for name in names}
    trials = [TrialConfig(name) for name in names]
    objects = made.list_objects(trials, loaded)
    scenes = made.describe_images(trials, loaded, objects, SMALL, "test").scenes
    tower, castles, gearbox = (scenes[str(k)].parts for k in (1, 2, 3))
    assert tower["castle1"] != tower["castle2"]  # of another colour
    assert {tower[part] for part in ("castle1", "castle2", "stick")} >= {*castles.values()}
    assert gearbox["disc1"] == gearbox["disc2"] == gearbox["disc3"] != gearbox["axle1"]
    assert sorted({*tower.values(), *castles.values(), *gearbox.values()}) == [*range(1, len(objects) + 1)]


def test_secret_trials_show_no_poses(tmp_path: Path) -> None:
    secret = SecretSeed(bytes(range(16)))
    images = make(tmp_path / "set", "block_on_block", secret_seed=secret)
    kept = {path.name for path in (images / "test" / "000001").iterdir()}
    assert kept == {"depth", "scene_camera.json", "scene_detections.json"}
    assert read_image_description(images).secret_seed == secret.hash
    assert secret.secret.hex() not in "".join(path.read_text() for path in images.rglob("*.json"))
    assert read(images / "detections.json")


def test_an_interrupted_set_is_completed_with_the_same_bytes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    config = replace(SMALL, depth_noise_mm=1.0, camera_error_mm=1.0)
    whole = make(tmp_path / "whole", "block_on_block", range(3), config)
    write, count = made.write_scene, 0

    def interrupt(*given: Any) -> None:
        nonlocal count
        count += 1
        write(*given)
        if count == 2:  # as if it had been interrupted in the middle of the second scene
            (given[-1] / "scene_detections.json").unlink()
            raise KeyboardInterrupt

    monkeypatch.setattr(made, "write_scene", interrupt)
    with pytest.raises(KeyboardInterrupt):
        make(tmp_path / "parts", "block_on_block", range(3), config)
    assert len([*(tmp_path / "parts" / "test").glob("*/scene_detections.json")]) == 1
    monkeypatch.undo()
    parts = make(tmp_path / "parts", "block_on_block", range(3), config)
    files = sorted(path.relative_to(whole) for path in whole.rglob("*") if path.is_file())
    assert files == sorted(path.relative_to(parts) for path in parts.rglob("*") if path.is_file())
    for file in files:
        assert (whole / file).read_bytes() == (parts / file).read_bytes(), file


def test_other_images_are_not_mixed(images: Path) -> None:
    with pytest.raises(InputError, match="other trials or options"):
        make(images, config=SMALL)


@pytest.mark.parametrize(
    ("wrong", "sentence"),
    [
        ({"cameras": 3}, "images, cameras: 1 or 2 or 4 is needed, 3 was given"),
        ({"width": 5000}, "images, width: a whole number <= 1280 is needed, 5000 was given"),
        ({"depth_noise_mm": -1.0}, "images, depth_noise_mm: a number >= 0.0 is needed, -1.0 was given"),
        ({"distance_mm": 20.0}, "images, distance_mm: a number >= 100.0 is needed, 20.0 was given"),
    ],
)
def test_impossible_cameras_are_refused(wrong: dict[str, Any], sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        convert_typed(wrong, ImageConfig, "images")


def test_the_published_camera_differs_by_its_error() -> None:
    config = replace(SMALL, camera_error_mm=2.0, camera_error_deg=0.5, cameras=4)
    pairs = [pair for seed in range(200) for pair in draw_views(config, np.random.default_rng(seed))]
    errors = np.array([pose.log(pose.inverse(p.published.T_world_view) @ p.true.T_world_view) for p in pairs])
    assert errors[:, :3].std() == pytest.approx(2e-3, rel=0.1)
    assert errors[:, 3:].std() == pytest.approx(np.radians(0.5), rel=0.1)
    exact = draw_views(replace(config, camera_error_mm=0.0, camera_error_deg=0.0), np.random.default_rng(0))
    assert all(np.allclose(p.published.T_world_view, p.true.T_world_view) for p in exact)


def test_depth_noise_grows_with_the_squared_depth() -> None:
    rng = np.random.default_rng(0)
    near, far = (add_depth_noise(np.full((300, 300), z), 1.0, rng) for z in (1.0, 2.0))
    assert np.std(near[near > 0]) == pytest.approx(1e-3, rel=0.05)
    assert np.std(far[far > 0]) == pytest.approx(4e-3, rel=0.05)
    assert np.mean(near == 0.0) == pytest.approx(0.01, rel=0.2)
    exact = add_depth_noise(np.array([[1.0, np.inf]]), 0.0, rng)
    assert np.array_equal(exact, [[1.0, 0.0]])


def test_inexact_detections_move_and_grow_by_their_error() -> None:
    mask = np.zeros((200, 200), dtype=np.bool_)
    mask[80:120, 60:140] = True
    rng = np.random.default_rng(0)
    found = [np.argwhere(disturb_mask(mask, 3.0, rng)) for _ in range(400)]
    middles = np.array([(each.max(axis=0) + each.min(axis=0)) / 2 for each in found]) - (99.5, 99.5)
    sizes = np.array([np.ptp(each, axis=0) + 1 for each in found]) - (40.0, 80.0)
    # 400 draws state a standard deviation to 3.5 %, and pixels round by 0.3
    assert middles.std(axis=0) == pytest.approx([3.0, 3.0], rel=0.15)
    assert sizes.std(axis=0) == pytest.approx([6.0, 6.0], rel=0.15)
    assert np.abs(middles.mean(axis=0)).max() < 0.7
    assert disturb_mask(mask, 0.0, rng) is mask
    assert disturb_mask(mask, 1e4, rng).any()


def test_annotations_are_exact_where_detections_are_not(tmp_path: Path) -> None:
    images = make(tmp_path / "set", "block_on_block", config=replace(SMALL, detection_error_px=3.0))
    exact = make(tmp_path / "exact", "block_on_block")
    assert read(images / "detections.json") != read(exact / "detections.json")
    for name in ("test/000001/scene_gt_coco.json", "test_targets_bop19.json"):
        assert read(images / name) == read(exact / name)


def test_images_between_operations_are_numbered_by_operation_and_are_no_targets(tmp_path: Path) -> None:
    images = make(tmp_path / "set", "block_on_block", config=replace(SMALL, video_hz=4.0))
    still = make(tmp_path / "still", "block_on_block")
    for name in ("detections.json", "test_targets_bop19.json", "test/000001/scene_gt_coco.json"):
        assert read(images / name) == read(still / name)
    truth = read(images / "test" / "000001" / "scene_gt.json")
    assert {path.stem for path in (images / "test" / "000001" / "depth").iterdir()} == {f"{int(k):06d}" for k in truth}
    for operation in (1, 2):
        frames = [int(image) for image in truth if int(image) // 10000 == operation]
        assert frames == [*range(10000 * operation + 1, 10000 * operation + len(frames) + 1)]
        assert len(frames) > 5
        shifts = np.array([[entry["cam_t_m2c"] for entry in truth[str(k)]] for k in frames])
        end = np.array([entry["cam_t_m2c"] for entry in truth[str(operation)]])
        # one part moved, and the last frame is where the image of the operation shows it, to what parts settle by
        assert (np.ptp(shifts, axis=0).max(axis=1) > 20.0).sum() == 1
        assert shifts[-1] == pytest.approx(end, abs=0.5)
    recalls = [
        measure_recall(each, read_image_description(each), read_results(write_truth(each))) for each in (images, still)
    ]
    assert recalls[0] == recalls[1]


def test_the_estimator_finds_parts_in_exact_depth(tmp_path: Path) -> None:
    """Within a millimetre of a pose that looks the same, for most parts, from depth of 1.5 mm wide pixels."""
    pytest.importorskip("small_gicp", reason="small_gicp, of the extra range, is not installed")
    images = make(tmp_path / "set", config=replace(SMALL, width=640, height=480))
    made = estimate_images(images, images / "icp.csv")
    rows = read_results(images / "icp.csv")
    truth = dict(list_truth(images))
    symmetries = read_symmetries(images / "models" / "models_info.json")
    good = 0
    for where, R, t_mm in zip(rows.where.tolist(), rows.R, rows.t_mm, strict=True):
        T = truth[tuple(where)]
        alike = pose.rigid(T[:3, :3], 1e3 * T[:3, 3]) @ symmetries[where[2]].images
        far = np.linalg.norm(alike[:, :3, 3] - t_mm, axis=1)
        turned = np.degrees(np.linalg.norm(pose.log(pose.inverse(alike) @ pose.rigid(R, t_mm))[:, 3:], axis=1))
        good += bool(((far < 1.0) & (turned < 1.5)).any())
    assert made == len(rows.where) >= 8
    assert good >= 7
