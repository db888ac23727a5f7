"""Logs: recorder, file format and reader. A new signal goes into one of the sources (`wbc.app.log.sources`).

    with Recorder("walk.arrow") as record:
        record.add("battery/voltage", lambda tick: battery.voltage, unit="V")    # a further signal
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

Numbers are 4-byte floats, `time` and `tick/clock` 8-byte ones; what was not measured is NaN, texts are null in ticks
without one. The metadata of each column hold its unit and meaning, those of the file, under the key `wbc`, one JSON
object (`wbc.app.log.header`). Names read `group/what/…/axis`; `wbc plot LOG --list` names those of a log.

Ticks are written in batches of 256. A program that is killed loses the ticks after the last batch; `Log.open` reads the
rest, and other programs read it as an Arrow stream that begins at byte 8 of the file::

    file = open("walk.arrow", "rb"); file.seek(8); reader = pyarrow.ipc.open_stream(file)
"""
