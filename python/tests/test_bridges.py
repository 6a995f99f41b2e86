"""The bridges of `examples/bridges`: what comes out of each is what the command estimates of the same samples."""

from __future__ import annotations

import importlib.util
import json
import socket
import threading
import time
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
from conftest import EXAMPLES

import kalmems
from kalmems import filters

FILE, SAMPLES = EXAMPLES / "shared_scanner/stream.toml", EXAMPLES / "shared_scanner/recording.csv"


def bridge(name: str) -> ModuleType:
    described = importlib.util.spec_from_file_location(f"bridge_{name}", EXAMPLES / f"bridges/{name}.py")
    assert described is not None and described.loader is not None
    module = importlib.util.module_from_spec(described)
    described.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def expected() -> list[kalmems.Estimate]:
    with SAMPLES.open("rb") as file:
        return [one for one in kalmems.Experiment.load(FILE).stream([file.read()]) if isinstance(one, kalmems.Estimate) and one.filter == "ekf"]


def pieces() -> list[bytes]:
    text = SAMPLES.read_bytes()
    return [text[start : start + 10_000] for start in range(0, len(text), 10_000)]


def free_port() -> int:
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


def test_zeromq(expected: list[kalmems.Estimate]) -> None:
    zmq = pytest.importorskip("zmq")
    source, target = (f"tcp://127.0.0.1:{free_port()}" for _ in range(2))
    context = zmq.Context.instance()
    with context.socket(zmq.PUB) as samples, context.socket(zmq.SUB) as estimates:
        samples.bind(source)
        estimates.connect(target)
        estimates.subscribe(b"ekf")
        estimates.setsockopt(zmq.RCVTIMEO, 20_000)
        # A publisher keeps nothing for a subscriber that is not there yet.
        samples.setsockopt(zmq.SNDHWM, 0)
        estimates.setsockopt(zmq.RCVHWM, 0)
        work = threading.Thread(target=bridge("zeromq").main, args=(FILE, source, target), daemon=True)
        work.start()
        time.sleep(1.0)
        for piece in [*pieces(), b""]:
            samples.send(piece)
        found = []
        while len(found) < 1000:
            name, body = estimates.recv_multipart()
            if name == b"ekf":
                found.append(json.loads(body))
    work.join(20)
    by_time = {one.time: one for one in expected}
    assert all({"time_s": one["time_s"], **by_time[one["time_s"]].values} == one for one in found)


class Broker:
    """A client of paho that is given the samples: it stands for the library and its broker."""

    def __init__(self) -> None:
        self.on_message: Any = None
        self.published: list[tuple[str, str]] = []
        self.topics: list[str] = []

    def subscribe(self, topic: str) -> None:
        self.topics.append(topic)

    def loop_start(self) -> None:
        class Message:
            def __init__(self, payload: bytes) -> None:
                self.payload = payload

        for piece in [*pieces(), b""]:
            self.on_message(self, None, Message(piece))

    def publish(self, topic: str, payload: str) -> None:
        self.published.append((topic, payload))

    def loop_stop(self) -> None:
        self.topics.append("stopped")


def test_mqtt_with_a_client_that_stands_for_the_library(expected: list[kalmems.Estimate]) -> None:
    broker = Broker()
    bridge("mqtt").follow(broker, FILE, "lab/samples", "lab/motion")
    found = [json.loads(payload) for topic, payload in broker.published if topic == "lab/motion/ekf"]
    assert found == [{"time_s": one.time, **one.values} for one in expected]
    assert any(topic == "lab/motion/event" for topic, _ in broker.published) and broker.topics == ["lab/samples", "stopped"]


def test_lab_streaming_layer() -> None:
    try:
        import pylsl
    except (ImportError, RuntimeError) as error:
        pytest.skip(f"pylsl: {error}")
    table = np.genfromtxt(SAMPLES, delimiter=",", names=True)
    name = f"scanner {time.time_ns()}"
    outlet = pylsl.StreamOutlet(pylsl.StreamInfo(name, "samples", 2, 1e6, "double64", name))
    work = threading.Thread(target=bridge("lsl").main, args=(FILE, name, 2.0), daemon=True)
    work.start()
    if not outlet.wait_for_consumers(5):
        pytest.skip("the machine's network does not let the layer find its streams")
    rows, start = np.stack([table["drive_V"], table["cap_V"]], axis=1), pylsl.local_clock()
    for first in range(0, len(rows), 500):
        count = len(rows[first : first + 500])
        outlet.push_chunk(np.ascontiguousarray(rows[first : first + count]), start + 1e-6 * (first + count - 1))
    found = pylsl.resolve_byprop("source_id", f"kalmems {name}", timeout=15)
    work.join(30)
    assert not work.is_alive()
    # The layer rounds times to the resolution of its clock; the stream exists and has the numbers of the filter.
    if not found:
        pytest.skip("the estimates' stream was not found in time")
    assert found[0].channel_count() == 10


def test_foxglove(tmp_path: Path, expected: list[kalmems.Estimate]) -> None:
    pytest.importorskip("foxglove")
    target = tmp_path / "motion.mcap"
    bridge("foxglove_log").main(FILE, SAMPLES, target)
    content = target.read_bytes()
    assert content.startswith(b"\x89MCAP") and content.endswith(b"\x89MCAP0\r\n") and b"/motion/ekf" in content
    mcap = pytest.importorskip("mcap.reader")
    with target.open("rb") as file:
        messages = [json.loads(message.data) for _, channel, message in mcap.make_reader(file).iter_messages() if channel.topic == "/motion/ekf"]
    assert messages == [{"time_s": one.time, **one.values} for one in expected]


def test_functions_for_labview(expected: list[kalmems.Estimate]) -> None:
    labview = bridge("labview")
    table = np.genfromtxt(SAMPLES, delimiter=",", names=True)
    rows = np.stack([table[name] for name in ("time_s", "drive_V", "cap_V")], axis=1).tolist()
    number, found = labview.open(str(FILE)), []
    for first in range(0, len(rows), 1000):
        assert labview.push(number, rows[first : first + 1000]) >= 0
        found += labview.poll(number, "ekf")
    found += labview.close(number, "ekf")
    assert found == [[one.time, *(np.nan if value is None else value for value in one.values.values())] for one in expected]
    failing = labview.open(str(EXAMPLES / "shared_scanner/experiment.toml"))
    with pytest.raises(kalmems.ExperimentError, match="add a table `\\[stream\\]`"):
        labview.close(failing, "ekf")


def test_scikit_learn() -> None:
    pytest.importorskip("sklearn")
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    random = np.random.default_rng(4)
    level = np.cumsum(random.normal(0, 0.1, 2000))
    samples = (level + random.normal(0, 0.5, 2000))[:, None]
    one = bridge("scikit").Level()
    smoothed = one.fit_transform(samples)[:, 0]
    assert one.fit_.converged and abs(one.fit_.values["r"] - 0.25) < 4 * one.fit_.sd["r"]
    assert np.std(smoothed - level) < 0.5 * np.std(samples[:, 0] - level)
    assert one.score(samples) == pytest.approx(one.fit_.log_likelihood / 2000, rel=1e-9)
    scaled = make_pipeline(StandardScaler(), bridge("scikit").Level())
    back = scaled.fit_transform(samples)[:, 0] * samples.std() + samples.mean()
    assert np.allclose(back, smoothed, atol=1e-2)


@pytest.fixture(scope="module")
def level() -> tuple[filters.Likelihood, filters.Fit]:
    """A level that walks at random and is measured, with both variances sought."""
    random = np.random.default_rng(11)
    z = np.cumsum(random.normal(0, 0.3, 400)) + random.normal(0, 0.5, 400)

    def model(q: float, r: float) -> dict[str, Any]:
        return {"F": 1, "H": 1, "Q": q, "R": r, "x0": 0, "P0": 10}

    start: dict[str, Any] = {"model": model, "start": {"q": 0.1, "r": 0.2}, "z": z, "positive": ("q", "r")}
    return filters.likelihood(**start), filters.fit(**start)


def is_posterior(draws: np.ndarray, fitted: filters.Fit) -> bool:
    """Whether draws of the logarithms have the mean and the deviation of the likelihood, which is all but normal: within a fifth of a deviation."""
    best, sd = np.log(list(fitted.values.values())), np.sqrt(np.diag(fitted.covariance))
    return bool((np.abs(draws.mean(axis=0) - best) < 0.2 * sd).all() and (np.abs(draws.std(axis=0) / sd - 1) < 0.2).all())


def test_numpyro(level: tuple[filters.Likelihood, filters.Fit]) -> None:
    jax = pytest.importorskip("jax")
    jax.config.update("jax_enable_x64", True)
    of, fitted = level
    log_likelihood, at = bridge("samplers").for_jax(of), np.log([0.05, 0.3])
    # ln p(z) + ln p(x), of a normal prior of each logarithm, compiled.
    value, slope = jax.jit(jax.value_and_grad(lambda x: log_likelihood(x) - 0.5 * (x**2).sum()))(at)
    assert float(value) == pytest.approx(of(at) - 0.5 * float(at @ at), rel=1e-12)
    assert np.allclose(slope, of.gradient(at) - at, rtol=1e-12)
    numpyro, infer = pytest.importorskip("numpyro"), pytest.importorskip("numpyro.infer")

    def model() -> None:
        numbers = numpyro.sample("numbers", numpyro.distributions.Normal(np.log([0.1, 0.2]), 10).to_event(1))
        numpyro.factor("samples", log_likelihood(numbers))

    work = infer.MCMC(infer.NUTS(model), num_warmup=300, num_samples=1000, progress_bar=False)
    work.run(jax.random.PRNGKey(1))
    assert is_posterior(np.asarray(work.get_samples()["numbers"]), fitted)


def test_pymc(level: tuple[filters.Likelihood, filters.Fit]) -> None:
    pymc = pytest.importorskip("pymc")
    of, fitted = level
    log_likelihood, at = bridge("samplers").for_pymc(of), np.log([0.05, 0.3])
    with pymc.Model() as model:
        numbers = pymc.Normal("numbers", np.log([0.1, 0.2]), 10, shape=2)
        pymc.Potential("samples", log_likelihood(numbers))
    value, slope = model.compile_logp(model.potentials)({"numbers": at}), model.compile_dlogp()({"numbers": at})
    assert float(value) == pytest.approx(of(at), rel=1e-12)
    assert np.allclose(slope, of.gradient(at) - 0.01 * (at - np.log([0.1, 0.2])), rtol=1e-12)
    with model:
        trace = pymc.sample(1000, tune=300, chains=1, cores=1, random_seed=1, progressbar=False, compute_convergence_checks=False)
    assert is_posterior(trace.posterior["numbers"].to_numpy()[0], fitted)
