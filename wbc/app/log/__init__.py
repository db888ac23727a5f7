"""Logs: every signal of every tick in one file that other programs open, too.

    with Recorder("walk.arrow") as record:
        record.add("battery/voltage", lambda: battery.voltage, unit="V")    # a signal of one's own
        while plant.time < 10.0:
            measurement = plant.measure()
            command = control.command(measurement)
            record(plant, control, measurement, command)
            plant.step(command)

    walk(spec, hooks=[Recorder("walk.arrow")])      # the same as a hook

    log = Log.open("walk.arrow")
    log.time, log["com/estimated/x"], log["com/estimated"], log.units["com/estimated/x"]

The file is an Arrow IPC file, also known as Feather version 2: one row a tick, one column a signal, compressed with
LZ4. It needs nothing of ours to be read::

    pandas.read_feather("walk.arrow")       polars.read_ipc("walk.arrow")

Numbers are 4-byte floats (7 digits), `time` and `tick/clock` 8-byte ones; NaN is what was not measured. Phases, events
and states are texts, null where there is none. The metadata of a column say its unit and what it is; those of the
file hold, under the key `wbc`, one JSON object: format, versions, seed, specification, robot and plant
(`wbc.app.log.header`).

Names read `group/what/…/axis`. Sides are `left` and `right`, joints have their own names, axes are x y z, quaternions
x y z w, wrenches fx fy fz mx my mz. What only a simulation knows begins with `truth/`.

    time, tick/…            clock and wall times of the controller's parts
    solver/…                status, iterations, residual of each task, active limits
    joint/…                 position, velocity, their references, torque sent
    imu/…, foot/<side>/…    other measurements; wrenches measured, desired and solved for; references and corrections
    base/…                  estimated and commanded base
    com/… dcm/… zmp/…       reference, estimated, measured, desired
    stabilizer/…, walk/…, step/…   what was decided: phase, step, events, next landing
    stiffness/…             of soles that are set: scan, decision and result, once a step, when the foot lands
    truth/…                 base, joints and their torques, soles and their hinges, centre of mass, pushes

A batch of 256 ticks is written at a time. A program that is killed loses what came after the last batch; the rest is
read by `Log.open`, and by others as an Arrow stream that begins at byte 8 of the file::

    file = open("walk.arrow", "rb"); file.seek(8); reader = pyarrow.ipc.open_stream(file)
"""

from wbc.app.log.reader import Log
from wbc.app.log.recorder import Recorder
from wbc.app.log.table import Signal

__all__ = ["Log", "Recorder", "Signal"]
