"""The wrist sensor: weights, noise, blows, zeroing, and that it is off unless it is used."""

from __future__ import annotations

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

from apo_bench import Scene
from apo_bench.records import FtNoise
from apo_bench.simulation.robot.forces import Guard
from apo_bench.simulation.robot.wrist import BANDWIDTH_HZ, OFFSETS, WristSensor
from apo_bench.simulation.scene.world import switch_wrist_sensors_on


def wrist(scene: Scene, noise: FtNoise, seed: int = 1, **settings) -> SimpleNamespace:
    """A sensor whose signal is set by hand, of an arm at home."""
    data = np.zeros(scene.work.model.nsensordata)
    rng = np.random.default_rng(seed)
    sensor = WristSensor(scene, data, lambda: np.array(scene.arm.home), noise, rng, **settings)
    return SimpleNamespace(sensor=sensor, signal=data[-6:])


def shown(made: SimpleNamespace, steps: int, step_s: float = 0.001) -> np.ndarray:
    """The wrench at the sensor's origin after each reading, (readings, 6), world."""
    at = made.sensor._sensor()[:3, 3]
    return np.array([made.sensor.wrench(at) for _ in range(steps) if made.sensor.take(step_s)])


def of_weights(made: SimpleNamespace) -> np.ndarray:
    """What the hand alone shows, (6,), in the frame of the sensor."""
    return made.sensor._weights @ made.sensor._sensor()[2, :3]


def test_noise_is_white_at_a_thousand_readings_a_second_and_behind_the_low_pass_as_stated(tower: Scene) -> None:
    made = wrist(tower, FtNoise(0.1, 0.005))
    felt = shown(made, 60_000)[100:]
    force, torque = made.sensor.sigma
    assert (force, torque) == pytest.approx((0.1 * 0.2241, 0.005 * 0.2241), rel=1e-3)
    assert felt[:, :3].std(axis=0) == pytest.approx(force, rel=0.05)
    assert felt[:, 3:].std(axis=0) == pytest.approx(torque, rel=0.05)
    # Behind a first-order low pass neighbours k readings apart have the correlation (1 - a)^k.
    part = np.exp(-2 * np.pi * BANDWIDTH_HZ * 0.001)
    for k in (1, 10):
        assert np.corrcoef(felt[:-k, 0], felt[k:, 0])[0, 1] == pytest.approx(part**k, abs=0.03)


def test_the_offset_of_a_trial_is_drawn_and_zeroing_removes_it(tower: Scene) -> None:
    offsets = []
    for seed in range(200):
        made = wrist(tower, FtNoise(0.1, 0.005), seed)
        offsets.append(made.sensor._offset)
    assert np.std(offsets, axis=0)[:3] == pytest.approx(0.1 * OFFSETS, rel=0.15)
    weight = np.array(of_weights(made))
    made.signal[:] = weight
    assert np.abs(shown(made, 500)[-1][:3]).max() > 0.5
    made.sensor.start_zero()
    shown(made, 500)
    made.sensor.end_zero()
    # 500 readings have a mean with 0.1 / sqrt(500) = 0.0045 N, what is felt then 0.022 N.
    felt = shown(made, 500)[-200:].mean(axis=0)
    assert np.abs(felt[:3]).max() < 0.03
    assert np.abs(felt[3:]).max() < 0.0015


def test_force_and_torque_are_those_of_the_surroundings_about_a_point(tower: Scene) -> None:
    """5 N upwards at a point 50 mm in front of the sensor's origin, in x: about that point there is no torque."""
    made = wrist(tower, FtNoise(0.0, 0.0))
    T = made.sensor._sensor()
    point = T[:3, 3] + [0.05, 0.0, 0.0]
    force = np.array([0.0, 0.0, 5.0])
    torque = np.cross(point - T[:3, 3], force)
    made.signal[:] = of_weights(made) - np.concatenate([T[:3, :3].T @ force, T[:3, :3].T @ torque])
    made.sensor.take(0.001)
    assert made.sensor.wrench(point) == pytest.approx([0, 0, 5, 0, 0, 0], abs=1e-9)
    assert made.sensor.wrench(T[:3, 3]) == pytest.approx([0, 0, 5, 0, -0.25, 0], abs=1e-9)
    assert made.sensor.stops(Guard(np.array([0.0, 0.0, -1.0]), 4.9))
    assert not made.sensor.stops(Guard(np.array([0.0, 0.0, -1.0]), 5.1))
    assert not made.sensor.stops(None)


def test_the_wrist_sensors_are_off_unless_switched_on(tower: Scene) -> None:
    model = tower.work.model
    data = mujoco.MjData(model)
    for _ in range(3):
        mujoco.mj_step(model, data)
    assert not data.sensordata[-6:].any()
    with switch_wrist_sensors_on(model):
        mujoco.mj_step(model, data)
        assert data.sensordata[-6:].any()
        with pytest.raises(RuntimeError), switch_wrist_sensors_on(model):
            raise RuntimeError
        assert model.sensor_needstage[-2:].tolist() == [3, 3]
    assert model.sensor_needstage[-2:].tolist() == [0, 0]


def test_many_readings_at_once_are_those_one_by_one(tower: Scene) -> None:
    rows = np.random.default_rng(2).normal(size=(70, 6))
    one, many = (wrist(tower, FtNoise(0.1, 0.005)) for _ in range(2))
    for row in rows:
        one.signal[:] = row
        one.sensor.take(0.001)
    for some in np.split(rows, [20, 30, 50]):
        many.sensor.take_rows(some, 0.001)
    about = one.sensor._sensor()[:3, 3]
    # the same sums in another order
    np.testing.assert_allclose(many.sensor.wrench(about), one.sensor.wrench(about), rtol=1e-9, atol=1e-12)
    half = wrist(tower, FtNoise(0.0, 0.0))
    half.sensor.take_rows(np.repeat(rows, 2, axis=0), 0.0005)
    none = wrist(tower, FtNoise(0.0, 0.0))
    none.sensor.take_rows(rows, 0.001)
    np.testing.assert_allclose(half.sensor.wrench(about), none.sensor.wrench(about), rtol=1e-9, atol=1e-12)
