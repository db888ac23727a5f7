"""Logs: recorder, file format and reader. A new signal goes into one of the sources (`wbc.app.log.sources`).

    with Recorder("walk.arrow") as record:
        record.add("battery/voltage", lambda: battery.voltage, unit="V")    # a further signal
        while plant.time < 10.0:
            measurement = plant.measure()
            command = control.command(measurement)
            record(plant, control, measurement, command)
            plant.step(command)

    walk(spec, hooks=[Recorder("walk.arrow")])      # the same as a hook

    log = Log.open("walk.arrow")
    log.time, log["com/estimated/x"], log["com/estimated"], log.units["com/estimated/x"]

The file is an Arrow IPC file, also known as Feather version 2: one row a tick, one column a signal, compressed with
LZ4. Other programs read it without this library::

    pandas.read_feather("walk.arrow")       polars.read_ipc("walk.arrow")

Numbers are 4-byte floats (7 digits), `time` and `tick/clock` 8-byte ones; missing measurements are NaN. Phases,
events and states are texts, null in ticks without one. The metadata of a column hold its unit and description; those of
the file hold, under the key `wbc`, one JSON object: format, versions, seed, specification, robot and plant
(`wbc.app.log.header`).

Names read `group/what/…/axis`. Sides are `left` and `right`, joints have their own names, axes are x y z, quaternions
x y z w, wrenches fx fy fz mx my mz. Ground truth of a simulation begins with `truth/`.

    time, tick/…            time stamp, wall-clock time, timings of the controller's parts
    solver/…                status, iterations, residual of each task, active limits of the QP
    joint/…                 position, velocity, their references, torque sent
    imu/…, foot/<side>/…    other measurements; wrenches measured, desired and solved for; references and corrections
    base/…                  estimated and commanded base
    com/… dcm/… zmp/…       reference, estimated, measured, desired
    program/…               state of a program, and states that have ended
    stabilizer/…, walk/…, step/…   feedback, phase, step, events, next landing
    stiffness/…             of variable soles: scan, decision and result, once a step, at the landing
    truth/…                 base, joints and their torques, soles and their hinges, centre of mass, pushes

Ticks are written in batches of 256. A program that is killed loses the ticks after the last batch; `Log.open` reads the
rest, and other programs read it as an Arrow stream that begins at byte 8 of the file::

    file = open("walk.arrow", "rb"); file.seek(8); reader = pyarrow.ipc.open_stream(file)
"""

from wbc.app.log.reader import Log
from wbc.app.log.recorder import Recorder
from wbc.app.log.signals import Signal, Tick

__all__ = ["Log", "Recorder", "Signal", "Tick"]
