"""Holds FMUs against what Rust computed, with FMPy: prints nothing but what is asked for."""

import csv
import sys

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


def opened(path):
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
    if is_two:
        slave.setupExperiment(startTime=0.0)
        slave.enterInitializationMode()
    else:
        slave.enterInitializationMode(startTime=0.0)
    slave.exitInitializationMode()
    return slave, references


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
    assert second.getReal(stroke) != wanted, "a reset"


def diverged(path):
    """A step that is far too long ends with an error, and a good state goes on."""
    slave, references = opened(path)
    state = slave.getFMUstate()
    slave.setReal([references["step"]], [0.05])
    try:
        for k in range(200):
            slave.doStep(0.05 * k, 0.05)
        print("no error")
    except Exception:
        pass
    slave.setFMUstate(state)
    slave.doStep(0.0, 1e-3)
    for wrong in (0.33e-4, 0.0):
        try:
            slave.doStep(1e-3, wrong)
            print("a step of", wrong, "is taken")
        except Exception:
            pass
    try:
        slave.setReal([references["stroke"]], [0.1])
        print("an output is set")
    except Exception:
        pass


def uneven(path):
    """A step of the simulated crane that the control period is no multiple of is refused, each time, and a good one goes on."""
    slave, references = opened(path)
    good = slave.getReal([references["step"]])
    for wrong in (0.0, -1e-5, 3e-4, 1e-12, 1.0):
        slave.setReal([references["step"]], [wrong])
        try:
            slave.doStep(0.0, 1e-3)
            print("a step of", wrong, "is taken")
        except Exception:
            pass
    slave.setReal([references["step"]], good)
    slave.doStep(0.0, 1e-3)


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
    """The controller on the plant along a course; the RMS error of the position in mm."""
    machine, of = opened(plant)
    brain, to = opened(controller)
    square = count = 0
    rows = list(csv.reader(open(course)))[1:]
    # the plant's motor turns as it is told
    speed = 0.0
    for k, (position, velocity) in enumerate(rows):
        stroke, load = machine.getReal([of["stroke"], of["load_pressure"]])
        square += (stroke - float(position)) ** 2
        count += 1
        names = ["reference_position", "reference_velocity", "stroke", "load_pressure"]
        brain.setReal([to[n] for n in names], [float(position), float(velocity), stroke, load])
        if "motor_speed_read" in to:
            brain.setReal([to["motor_speed_read"]], [speed])
        brain.doStep(k * 1e-3, 1e-3)
        [speed] = brain.getReal([to["motor_speed"]])
        machine.setReal([of["pump_speed"]], [speed])
        machine.doStep(k * 1e-3, 1e-3)
    print((square / count) ** 0.5 * 1e3)


if __name__ == "__main__":
    {"validated": validated, "simulated": simulated, "kept": kept, "diverged": diverged, "uneven": uneven, "sloped": sloped, "closed": closed}[sys.argv[1]](*sys.argv[2:])
