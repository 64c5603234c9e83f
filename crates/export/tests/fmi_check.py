"""Holds FMUs against what Rust computed, with FMPy: prints nothing but what is asked for."""

import csv
import sys
from itertools import accumulate
from array import array

from fmpy import extract, read_model_description
from fmpy.fmi2 import FMU2Slave
from fmpy.fmi3 import FMU3Slave
from fmpy.validation import validate_fmu


def validated(path):
    for message in validate_fmu(path):
        print(message)


def simulated(path, inputs, outputs):
    """Steps an FMU by a millisecond under given inputs; the outputs after each step, in full digits."""
    rows = list(csv.reader(open(inputs)))
    slave, references = opened(path)
    names = rows[0]
    for k, row in enumerate(rows[1:]):
        slave.setReal([references[n] for n in names], [float(v) for v in row])
        slave.doStep(currentCommunicationPoint=k * 1e-3, communicationStepSize=1e-3)
        print(",".join(repr(v) for v in slave.getReal([references[n] for n in outputs.split("+")])))
    slave.terminate()
    slave.freeInstance()


def replayed(path, given, found):
    """Feeds a controller its inputs, numbers of 8 bytes, in each period those that have changed, and writes what it shows."""
    variables = read_model_description(path).modelVariables
    slave, _ = opened(path)
    inputs = [v for v in variables if v.causality == "input"]
    outputs = [v.valueReference for v in variables if v.causality == "output"]
    sizes = [v.shape[0] if getattr(v, "shape", ()) else 1 for v in inputs]
    count = sum(sizes)
    ends = list(accumulate(sizes))
    places = [(v.valueReference, slice(end - size, end)) for v, size, end in zip(inputs, sizes, ends)]
    numbers = array("d", open(given, "rb").read())
    shown = array("d")
    before = [None] * len(places)
    for k in range(len(numbers) // count):
        row = numbers[k * count : (k + 1) * count]
        now = [row[place].tobytes() for _, place in places]
        changed = [n for n in range(len(places)) if now[n] != before[n]]
        before = now
        values = array("d", b"".join(now[n] for n in changed))
        if changed:
            slave.setReal([places[n][0] for n in changed], values)
        slave.doStep(currentCommunicationPoint=k * 1e-3, communicationStepSize=1e-3)
        shown.extend(slave.getReal(outputs))
    slave.terminate()
    slave.freeInstance()
    open(found, "wb").write(shown.tobytes())


class Three(FMU3Slave):
    """FMI 3.0 with the names of FMI 2.0, as far as they are used here."""

    def getReal(self, references):
        return list(self.getFloat64(references))

    def setReal(self, references, values):
        self.setFloat64(references, values)

    def getFMUstate(self):
        return self.getFMUState()

    def setFMUstate(self, state):
        self.setFMUState(state)

    def serializeFMUstate(self, state):
        return self.serializeFMUState(state)

    def deSerializeFMUstate(self, data):
        return self.deserializeFMUState(data)


def made(path):
    """An instance that is not initialized, the references of its variables, and how initialization mode is entered at a time."""
    description = read_model_description(path)
    references = {v.name: v.valueReference for v in description.modelVariables}
    is_two = description.fmiVersion == "2.0"
    slave = (FMU2Slave if is_two else Three)(
        guid=description.guid,
        unzipDirectory=extract(path),
        modelIdentifier=description.coSimulation.modelIdentifier,
        instanceName="one",
    )
    slave.instantiate()

    def entered(start=0.0, stop=None):
        if is_two:
            slave.setupExperiment(startTime=start, stopTime=stop)
            slave.enterInitializationMode()
        else:
            slave.enterInitializationMode(startTime=start, stopTime=stop)

    return slave, references, entered


def opened(path, start=0.0, stop=None):
    slave, references, entered = made(path)
    entered(start, stop)
    slave.exitInitializationMode()
    return slave, references


def refused(what, call, *arguments):
    """Says so where something is done that must not be."""
    try:
        call(*arguments)
        print(what, "is taken")
    except Exception:
        pass


def kept(path):
    """A state that was saved, and one that was serialized, lead to the same numbers again; a second instance has its own."""
    first, references = opened(path)
    second, _ = opened(path)
    speed, stroke = [references["pump_speed"]], [references["stroke"]]
    first.setReal(speed, [8.0])
    first.doStep(0.0, 0.2)
    state = first.getFMUstate()
    saved = first.serializeFMUstate(state)
    first.doStep(0.2, 0.3)
    wanted = first.getReal(stroke)
    first.setFMUstate(state)
    first.doStep(0.2, 0.3)
    assert first.getReal(stroke) == wanted, "a saved state"
    second.setFMUstate(second.deSerializeFMUstate(saved))
    second.setReal(speed, [8.0])
    second.doStep(0.2, 0.3)
    assert second.getReal(stroke) == wanted, "a serialized state"
    second.reset()
    if isinstance(second, FMU2Slave):
        second.setupExperiment(startTime=0.0)
        second.enterInitializationMode()
    else:
        second.enterInitializationMode(startTime=0.0)
    second.exitInitializationMode()
    assert second.getReal(stroke) != wanted, "a reset"


def diverged(path):
    """A damper that the step is far too long for ends with an error, and a good state goes on."""
    slave, references = opened(path)
    state = slave.getFMUstate()
    slave.setReal([references["friction_viscous_ns_per_m"], references["pump_speed"]], [1e7, 10.0])
    try:
        for k in range(200):
            slave.doStep(1e-3 * k, 1e-3)
        print("no error")
    except Exception:
        pass
    refused("a step after that", slave.doStep, 1e-3 * k, 1e-3)
    refused("a value after that", slave.setReal, [references["pump_speed"]], [1.0])
    slave.getReal([references["stroke"]])
    slave.setFMUstate(state)
    slave.doStep(0.0, 1e-3)
    for wrong in (0.33e-4, 0.0, -1e-3, float("nan"), float("inf")):
        refused(f"a step of {wrong}", slave.doStep, 1e-3, wrong)
    refused("an output", slave.setReal, [references["stroke"]], [0.1])
    refused("a variable that is not there", slave.setReal, [10**6], [0.1])
    slave.doStep(1e-3, 1e-3)


def disordered(path):
    """Calls out of order are refused, each with a message; what comes in order goes on."""
    slave, references, entered = made(path)
    stroke, payload, state = [references["stroke"]], [references["payload_mass_kg"]], [references["state_pressure_a"]]
    is_two = isinstance(slave, FMU2Slave)
    refused("a step before initialization", slave.doStep, 0.0, 1e-3)
    refused("reading before initialization", slave.getReal, stroke)
    refused("the end of an initialization that has not begun", slave.exitInitializationMode)
    refused("termination before initialization", slave.terminate)
    slave.setReal(payload, [310.0])
    entered()
    refused("a second initialization", slave.enterInitializationMode)
    refused("a step in initialization mode", slave.doStep, 0.0, 1e-3)
    refused("termination in initialization mode", slave.terminate)
    if is_two:
        refused("a set-up in initialization mode", slave.setupExperiment)
    slave.setReal(payload, [320.0])
    slave.setReal(state, slave.getReal(state))
    slave.exitInitializationMode()
    refused("a second end of initialization", slave.exitInitializationMode)
    refused("initialization between steps", slave.enterInitializationMode)
    refused("a state between steps", slave.setReal, state, [70e5])
    slave.setReal(payload, [330.0])
    slave.doStep(0.0, 1e-3)
    refused("a step from an earlier time", slave.doStep, 0.0, 1e-3)
    refused("a step from a later time", slave.doStep, 0.5, 1e-3)
    slave.doStep(1e-3, 1e-3)
    slave.terminate()
    slave.getReal(stroke)
    refused("a second termination", slave.terminate)
    refused("a step after termination", slave.doStep, 2e-3, 1e-3)
    refused("a value after termination", slave.setReal, payload, [300.0])
    slave.reset()
    refused("a step after a reset", slave.doStep, 0.0, 1e-3)
    entered(stop=1.5e-3)
    slave.exitInitializationMode()
    slave.doStep(0.0, 1e-3)
    refused("a step beyond the stop time", slave.doStep, 1e-3, 1e-3)
    slave.terminate()
    slave.freeInstance()


def impossible(path):
    """Values that a crane cannot have are refused, and the ones before are kept."""
    slave, of, entered = made(path)
    entered()
    for name, wrong in [
        ("cylinder_piston_mm", 0.0),
        ("payload_mass_kg", -1.0),
        ("payload_mass_kg", float("nan")),
        ("payload_mass_kg", float("inf")),
        ("payload_mass_kg", float("-inf")),
        ("step", 60e-6),
        ("step", 0.0),
        ("holding_valve", 1.5),
        ("pump_speed", 1e9),
        ("state_pressure_a", 2e8),
        ("state_angle_1", 7.0),
    ]:
        before = slave.getReal([of[name]])
        refused(f"{name} = {wrong}", slave.setReal, [of[name]], [wrong])
        assert slave.getReal([of[name]]) == before, name
    # one bad value among good ones, and none is taken
    before = slave.getReal([of["payload_mass_kg"]])
    refused("one of two", slave.setReal, [of["payload_mass_kg"], of["cylinder_piston_mm"]], [100.0, 0.0])
    assert slave.getReal([of["payload_mass_kg"]]) == before
    # what is allowed alone and not together
    for name, wrong in [
        ("cylinder_rod_mm", 65.0),
        ("geometry_shortest_mm", 1e5),
        ("accumulator_precharge_bar", 400.0),
        ("motion_start_mm", 600.0),
        ("payload_mass_kg", 1e6),
    ]:
        before = slave.getReal([of[name]])
        slave.setReal([of[name]], [wrong])
        refused(f"{name} = {wrong}", slave.exitInitializationMode)
        slave.setReal([of[name]], before)
    slave.exitInitializationMode()
    before = slave.getReal([of["cylinder_rod_mm"]])
    slave.setReal([of["cylinder_rod_mm"]], [80.0])
    refused("a rod thicker than its piston", slave.doStep, 0.0, 1e-3)
    slave.setReal([of["cylinder_rod_mm"]], before)
    slave.doStep(0.0, 1e-3)


def balanced(path, names, values, outputs):
    """With parameters set before, and in initialization mode: the outputs at the start, and the swing of p_A [Pa] in a second."""
    names, values = names.split("+"), [float(v) for v in values.split("+")]
    for mode in ("before", "in"):
        slave, of, entered = made(path)
        if mode == "before":
            slave.setReal([of[n] for n in names], values)
            entered()
        else:
            entered()
            slave.getReal([of["stroke"]])
            slave.setReal([of[n] for n in names], values)
        slave.exitInitializationMode()
        print(",".join(repr(v) for v in slave.getReal([of[n] for n in outputs.split("+")])))
        slave.setReal([of["holding_valve"]], [0.0])
        seen = slave.getReal([of["pressure_a"]])
        for k in range(1000):
            slave.doStep(k * 1e-3, 1e-3)
            seen += slave.getReal([of["pressure_a"]])
        print(max(seen) - min(seen))
        slave.freeInstance()


def own_state(path):
    """A state that the user has set is kept, and so is the start of an FMU of which nothing was set."""
    slave, of, entered = made(path)
    entered()
    states = [reference for name, reference in of.items() if name.startswith("state_")]
    pressure, payload = [of["state_pressure_a"]], [of["payload_mass_kg"]]
    begun = slave.getReal(states)
    # the same value is no change
    slave.setReal(payload, slave.getReal(payload))
    assert slave.getReal(states) == begun
    slave.setReal(payload, [500.0])
    rests = slave.getReal(states)
    assert rests != begun
    # a master that sets every start value of the description does not mean a state of its own
    slave.setReal(states, begun)
    assert slave.getReal(states) == rests
    slave.reset()
    slave.setReal(states + payload, begun + [500.0])
    entered()
    assert slave.getReal(states) == rests
    slave.reset()
    entered()
    slave.setReal(pressure, [50e5])
    slave.setReal(payload, [500.0])
    slave.exitInitializationMode()
    wanted = [50e5 if [reference] == pressure else value for reference, value in zip(states, begun)]
    assert slave.getReal(states) == wanted
    # a payload that is picked up between steps moves no state
    other, _ = opened(path)
    other.setReal(payload, [500.0])
    assert other.getReal(states) == begun


def late(path):
    """Steps at large times are those at small ones, however a master counts; what is no multiple is refused in the end."""
    wanted = None
    for start in (0.0, 1e6, -1e6, 3e7):
        for counts in ("multiplied", "added", "differences"):
            slave, of = opened(path, start)
            slave.setReal([of["pump_speed"]], [8.0])
            time = start
            for k in range(2000):
                if counts == "multiplied":
                    time = start + k * 1e-3
                length = 1e-3
                if counts == "differences":
                    length = (start + (k + 1) * 1e-3) - time
                slave.doStep(time, length)
                time += length
            seen = slave.getReal([of["stroke"], of["pressure_a"], of["velocity"]])
            wanted = wanted or seen
            assert seen == wanted, (start, counts, seen, wanted)
            slave.freeInstance()
    slave, of = opened(path)
    time = 0.0
    taken = 0
    try:
        for k in range(1000):
            # nine tenths of what is taken for rounding, each time
            length = 1e-3 + 0.9e-6 * 50e-6
            slave.doStep(time, length)
            time += length
            taken += 1
    except Exception:
        pass
    print(taken)


def sloped(path, unknown, known):
    """In motion: what the unknowns are, then how they change along each of what is known; and what is no such thing is refused."""
    slave, references = opened(path)
    slave.setReal([references["pump_speed"]], [8.0])
    slave.doStep(0.0, 0.2)
    unknown = [references[n] for n in unknown.split("+")]
    derivative = slave.getDirectionalDerivative
    print(",".join(repr(v) for v in slave.getReal(unknown)))
    for name in known.split("+"):
        print(",".join(repr(v) for v in derivative(unknown, [references[name]], [1.0])))
    for wrong in ([unknown[0]], [10**6]):
        try:
            derivative(unknown, wrong, [1.0])
            print("along an output")
        except Exception:
            pass


def closed(plant, controller, course):
    """The controller on the plant along a course; the RMS error of the position in mm, once the load is released."""
    machine, of = opened(plant)
    brain, to = opened(controller)
    rows = [[float(v) for v in row] for row in list(csv.reader(open(course)))[1:]]
    pressures = ["pressure_pump_a", "pressure_a", "pressure_b", "pressure_pump_b"]
    # the plant's motor turns as it is told
    speed = 0.0
    square = count = k = place = 0
    while place < len(rows):
        position, velocity = rows[place]
        stroke = machine.getReal([of["stroke"]])[0]
        given = {"reference_position": position, "reference_velocity": velocity, "stroke": stroke, "motor_speed_read": speed}
        given |= dict(zip(pressures, machine.getReal([of[name] for name in pressures])))
        given |= {"enable": 1.0, "start": float(k > 100)}
        brain.setReal([to[name] for name in given], list(given.values()))
        brain.doStep(k * 1e-3, 1e-3)
        [speed] = brain.getReal([to["motor_speed"]])
        valve, status, offset = brain.getReal([to[n] for n in ("holding_valve", "status", "reference_offset")])
        assert status < 10.0 and k < 60000, f"status {status} after {k} ms"
        machine.setReal([of["pump_speed"], of["holding_valve"]], [speed, valve])
        machine.doStep(k * 1e-3, 1e-3)
        k += 1
        if status == 4.0:
            square += (stroke - position - offset) ** 2
            count += 1
            place += 1
    print((square / count) ** 0.5 * 1e3)


if __name__ == "__main__":
    work = [replayed, validated, simulated, kept, diverged, disordered, impossible, balanced, own_state, late, sloped, closed]
    {function.__name__: function for function in work}[sys.argv[1]](*sys.argv[2:])
