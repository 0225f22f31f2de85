import numpy as np
import pytest

from analysis.motion.two_mass import TwoMassParameters
from app.runs.analysis_input import to_record
from app.runs.errors import RunExistsError
from app.runs.reader import open_run
from app.runs.simulated import write_simulated_run


def test_a_simulated_run_tells_its_truth(tmp_path):
    parameters = TwoMassParameters.from_free_decay(
        period_s=0.32, damping_n1_per_s=0.12, table_mass_kg=131.6, plate_mass_kg=22.4, friction_dynamic=0.1,
        pullback_m=0.012, gravity_m_per_s2=9.8,
    )  # fmt: skip
    motion = parameters.simulate(4.0)
    write_simulated_run(tmp_path / "run.h5", motion, parameters, series="1FFM0", rate_hz=500.0)

    run = open_run(tmp_path / "run.h5")

    assert len(run) == 2501
    assert np.array_equal(run.time_s, np.arange(2501) / 500.0)
    assert run.events.release_s == 1.0
    assert set(run.table_reading[:501]) == {0.012}
    assert set(run.relative_reading[:501]) == {0.0}
    table, relative = motion.sample_displacements(np.arange(2001) / 500.0)
    assert np.array_equal(run.table_reading[500:], table)
    assert np.array_equal(run.relative_reading[500:], relative)
    assert run.metadata.truth["friction_dynamic"] == 0.1
    assert run.metadata.truth["friction_static"] == 0.1
    assert (run.metadata.series, run.metadata.pullback_m) == ("1FFM0", 0.012)
    record = to_record(run)
    assert record.masses.gravity_m_per_s2 == 9.8
    assert record.table_gauge.gain_relative == 0.0
    with pytest.raises(RunExistsError):
        write_simulated_run(tmp_path / "run.h5", motion, parameters)
