/* A machine over the local interface (docs/reference/machine-interface.md): the simulated crane of hydroboom_live.h, with
 * a watchdog of its own.
 *     machine PORT [--simulated-time] */
#define _GNU_SOURCE
#include "hydroboom_live.h"
#include "hydroboom_machine.h"
#include <arpa/inet.h>
#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>

enum { PERIOD_NS = 1000000, WATCHDOG = 20, GIVEN_UP = 1000 /* periods without a command */ };
typedef unsigned char bytes[HYDROBOOM_MACHINE_LONGEST];
static struct hydroboom_header head = {HYDROBOOM_MACHINE_MAGIC, HYDROBOOM_MACHINE_VERSION, 0, 1, 0, {0}, 0, 0, 0, 0};
static struct hydroboom_command command;
static struct hydroboom_commanded_axis commanded;

static uint64_t now_ns(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (uint64_t)t.tv_sec * 1000000000u + (uint64_t)t.tv_nsec;
}

/* Sends head, body and check sum. */
static void put(int to, uint8_t kind, const void *body, size_t size) {
    bytes out;
    uint32_t sum;
    head.kind = kind;
    head.length = (uint16_t)(sizeof head + size + sizeof sum);
    memcpy(out, &head, sizeof head);
    memcpy(out + sizeof head, body, size);
    sum = hydroboom_crc32(out, sizeof head + size);
    memcpy(out + sizeof head + size, &sum, sizeof sum);
    send(to, out, head.length, 0);
}

/* Whether a valid datagram of that kind comes within a time; a command is kept where it is of this session, new, finite. */
static int take(int from, uint8_t kind, uint64_t wait_ns) {
    bytes in;
    struct hydroboom_header got;
    struct hydroboom_commanded_axis axis;
    struct timespec most = {(time_t)(wait_ns / 1000000000u), (long)(wait_ns % 1000000000u)};
    struct pollfd waited = {from, POLLIN, 0};
    uint32_t sum;
    ssize_t length = ppoll(&waited, 1, &most, NULL) > 0 ? recv(from, in, sizeof in, 0) : 0;
    if (length < (ssize_t)(sizeof got + sizeof command + sizeof axis + sizeof sum)) return 0;
    memcpy(&got, in, sizeof got);
    memcpy(&sum, in + length - sizeof sum, sizeof sum);
    if (memcmp(got.magic, head.magic, 4) || got.version != head.version || got.kind != kind || got.axes != 1
        || got.length != length || sum != hydroboom_crc32(in, (size_t)length - sizeof sum)) return 0;
    if (kind == HYDROBOOM_HELLO) return head.session = got.session, 1;
    memcpy(&axis, in + sizeof got + sizeof command, sizeof axis);
    if (got.session != head.session || got.sequence <= head.received
        || !isfinite(axis.motor_speed_rev_per_s) || !isfinite(axis.holding_valve)) return 0;
    memcpy(&command, in + sizeof got, sizeof command);
    commanded = axis;
    head.received = got.sequence;
    return 1;
}

int main(int count, char **given) {
    struct { struct hydroboom_hello head; struct hydroboom_ranges ranges; } hello = {
        {PERIOD_NS, HYDROBOOM_MACHINE_VERSION, HYDROBOOM_SIMULATED_MACHINE, 0, 0}, {{{0}}}};
    struct { struct hydroboom_measurement head; struct hydroboom_measured_axis axis; } seen = {{0}, {{0}, {0}, 0}};
    struct sockaddr_in controller = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
    int simulated = count > 2 && !strcmp(given[2], "--simulated-time"), held = 0, silent = 0;
    int to = socket(AF_INET, SOCK_DGRAM, 0);
    double speed = 0.0, valve = 0.0, is[64], last_mm = 0.0;
    hydroboom *crane = hydroboom_open(NULL, "start.preload_percent=0", NULL, 0);
    controller.sin_port = htons((uint16_t)atoi(count > 1 ? given[1] : "0"));
    if (!crane || connect(to, (struct sockaddr *)&controller, sizeof controller)) return 1;
    for (size_t k = 0; k < HYDROBOOM_MACHINE_SIGNALS; k++) hello.ranges.of[k][0] = hello.ranges.of[k][1] = NAN;
    do {
        nanosleep(&(struct timespec){0, 10000000}, NULL); /* where nobody is there, nothing is waited for in take */
        put(to, HYDROBOOM_HELLO, &hello, sizeof hello);
    } while (!take(to, HYDROBOOM_HELLO, 100000000));
    for (uint64_t release = now_ns(); silent < GIVEN_UP; release += PERIOD_NS) {
        int is_new = 0;
        hydroboom_read(crane, is, 64);
        seen.axis.signals[0] = is[0]; /* stroke; then, behind the velocity, the pressures in the interface's order */
        memcpy(seen.axis.signals + 1, is + 2, 5 * sizeof *is);
        seen.axis.signals[6] = speed;
        seen.axis.valve = valve > 0.5 ? HYDROBOOM_VALVE_OPEN : HYDROBOOM_VALVE_SHUT;
        seen.head.state = command.is_enabled ? HYDROBOOM_ENABLED : HYDROBOOM_READY;
        seen.head.sampled_ns = head.clock_ns = (uint64_t)llround(hydroboom_time(crane) * 1e9);
        head.sequence++;
        put(to, HYDROBOOM_MEASUREMENT, &seen, sizeof seen);
        if (simulated) is_new = take(to, HYDROBOOM_COMMAND, silent ? 1000000 : 500000000);
        for (uint64_t t; !simulated && (t = now_ns()) < release + PERIOD_NS;)
            is_new |= take(to, HYDROBOOM_COMMAND, release + PERIOD_NS - t);
        silent = is_new ? 0 : silent + 1;
        if (is_new && !held) last_mm = is[0] * 1e3;
        if (silent > WATCHDOG) held = 1; /* until the controller holds the load itself */
        else if (commanded.motor_speed_rev_per_s == 0.0 && commanded.holding_valve == 0.0) held = 0;
        if (!held && valve < 0.5 && commanded.holding_valve > 0.5)
            printf("released at %.9f mm\n", last_mm), fflush(stdout);
        speed = held ? 0.0 : commanded.motor_speed_rev_per_s;
        valve = held ? 0.0 : commanded.holding_valve;
        if (hydroboom_advance(crane, speed, valve, PERIOD_NS * 1e-9)) return 2;
    }
    printf("held, last command at %.9f mm, end at %.9f mm, motor %g rev/s, valve %g\n",
           last_mm, is[0] * 1e3, speed, valve);
    hydroboom_close(crane);
    return 0;
}
