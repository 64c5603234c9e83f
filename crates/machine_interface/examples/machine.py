"""A machine over the local interface (docs/reference/machine-interface.md): the simulated crane of the C library, with a watchdog of its own.
    python3 machine.py LIBRARY PORT [--simulated-time]
SIGUSR1 opens its stop circuit, and closes it again."""
import ctypes, math, select, signal, socket, struct, sys, time, zlib

PERIOD_NS, WATCHDOG, GIVEN_UP = 1_000_000, 20, 1000  # the last two in periods without a command
HELLO, MEASUREMENT, COMMAND = 1, 2, 3
READY, ENABLED, FAULT, SHUT, OPEN, SIMULATED_MACHINE = 2, 3, 4, 1, 2, 1
STOP_CIRCUIT_OPEN = 1  # fault code
HEAD = struct.Struct("<4sHBBH6xQQQQ")  # magic, version, kind, axes, length, session, sequence, received, clock

live = ctypes.CDLL(sys.argv[1])
live.hydroboom_open.restype = ctypes.c_void_p
live.hydroboom_time.restype = ctypes.c_double
live.hydroboom_time.argtypes = [ctypes.c_void_p]
live.hydroboom_advance.argtypes = [ctypes.c_void_p] + 3 * [ctypes.c_double]
live.hydroboom_read.argtypes = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_size_t]
crane = live.hydroboom_open(None, b"start.preload_percent=0", None, 0)
seen = (ctypes.c_double * 64)()
wire = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
wire.connect(("127.0.0.1", int(sys.argv[2])))  # what others send is not received
is_simulated = "--simulated-time" in sys.argv[3:]
is_open = False


def switch_stop_circuit(*_):
    global is_open
    is_open = not is_open


signal.signal(signal.SIGUSR1, switch_stop_circuit)


def put(kind, body, session=0, sequence=0, received=0, clock=0):
    datagram = HEAD.pack(b"HYDM", 1, kind, 1, HEAD.size + len(body) + 4, session, sequence, received, clock) + body
    try:
        wire.send(datagram + struct.pack("<I", zlib.crc32(datagram)))
    except ConnectionRefusedError:
        pass  # nobody is there yet, or any more


def take(kind, wait_s):
    """Session, sequence number and body of a valid datagram of that kind that comes within a time; else None."""
    try:
        datagram = wire.recv(1472) if select.select([wire], [], [], wait_s)[0] else b""
    except ConnectionRefusedError:
        time.sleep(wait_s)
        return None
    if len(datagram) < HEAD.size + 4 or struct.unpack("<I", datagram[-4:])[0] != zlib.crc32(datagram[:-4]):
        return None
    magic, version, got, axes, length, session, sequence, *_ = HEAD.unpack_from(datagram)
    is_valid = (magic, version, got, axes, length) == (b"HYDM", 1, kind, 1, len(datagram))
    return (session, sequence, datagram[HEAD.size:-4]) if is_valid else None


answer = None
while answer is None:
    put(HELLO, struct.pack("<IHB9x", PERIOD_NS, 1, SIMULATED_MACHINE) + struct.pack("<14d", *14 * [math.nan]))
    answer = take(HELLO, 0.1)
session, number, received, silent, is_held, last_mm = answer[0], 0, 0, 0, False, 0.0
enabled, command, speed, valve = 0, (0.0, 0.0), 0.0, 0.0
release = time.monotonic_ns()
while silent < GIVEN_UP:
    live.hydroboom_read(crane, seen, 64)
    stroke, _, *pressures = seen[:7]
    clock, number, is_new = round(live.hydroboom_time(crane) * 1e9), number + 1, False
    state = (FAULT, STOP_CIRCUIT_OPEN) if is_open else (ENABLED if enabled else READY, 0)
    head = struct.pack("<QBxH4x", clock, *state)
    axis = struct.pack("<7d7BB", stroke, *pressures, speed, *7 * [0], OPEN if valve > 0.5 else SHUT)
    put(MEASUREMENT, head + axis, session, number, received, clock)
    release += PERIOD_NS
    while not is_new or not is_simulated:
        wait_s = (0.001 if silent else 0.5) if is_simulated else (release - time.monotonic_ns()) * 1e-9
        came = take(COMMAND, max(wait_s, 0.0))  # late: what has come meanwhile
        if came and came[0] == session and came[1] > received and all(map(math.isfinite, struct.unpack("<8x2d", came[2]))):
            received, is_new = came[1], True
            enabled, *command = struct.unpack("<B7x2d", came[2])
        elif is_simulated or wait_s <= 0.0:
            break
    silent = 0 if is_new else silent + 1
    last_mm = stroke * 1e3 if is_new and not is_held else last_mm
    if silent > WATCHDOG or is_open:
        is_held = True  # until the controller holds the load itself
    elif tuple(command) == (0.0, 0.0):
        is_held = False
    if not is_held and valve < 0.5 < command[1]:
        print(f"released at {last_mm:.9f} mm", flush=True)
    speed, valve = (0.0, 0.0) if is_held else command
    if live.hydroboom_advance(crane, speed, valve, PERIOD_NS * 1e-9) != 0:
        sys.exit("the crane left what its model holds for")
print(f"held, last command at {last_mm:.9f} mm, end at {stroke * 1e3:.9f} mm, motor {speed:g} rev/s, valve {valve:g}")
