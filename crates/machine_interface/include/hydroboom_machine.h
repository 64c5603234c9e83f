/* Local interface of a machine, for C: docs/reference/machine-interface.md is the normative text. All numbers are little-endian; on a little-endian
 * computer these structures are the bytes of a datagram. Units are SI, motor speeds are in rev/s. */
#ifndef HYDROBOOM_MACHINE_H
#define HYDROBOOM_MACHINE_H

#include <stddef.h>
#include <stdint.h>

#define HYDROBOOM_MACHINE_MAGIC "HYDM"
#define HYDROBOOM_MACHINE_VERSION 1
#define HYDROBOOM_MACHINE_LONGEST 1472
#define HYDROBOOM_MACHINE_SIGNALS 7

enum { HYDROBOOM_HELLO = 1, HYDROBOOM_MEASUREMENT = 2, HYDROBOOM_COMMAND = 3 };
enum { HYDROBOOM_CONTROLLER = 0, HYDROBOOM_SIMULATED_MACHINE = 1, HYDROBOOM_REAL_MACHINE = 2 };
enum { HYDROBOOM_ABSENT = 0, HYDROBOOM_STARTING = 1, HYDROBOOM_READY = 2, HYDROBOOM_ENABLED = 3, HYDROBOOM_FAULT = 4 };
enum { HYDROBOOM_GOOD = 0, HYDROBOOM_NOT_MEASURED = 1, HYDROBOOM_OUT_OF_RANGE = 2, HYDROBOOM_STALE = 3 };
enum { HYDROBOOM_VALVE_UNKNOWN = 0, HYDROBOOM_VALVE_SHUT = 1, HYDROBOOM_VALVE_OPEN = 2 };

struct hydroboom_header {
    char magic[4];
    uint16_t version;
    uint8_t kind;
    uint8_t axes;
    uint16_t length;
    uint8_t zero[6];
    uint64_t session;
    uint64_t sequence;
    uint64_t received;
    uint64_t clock_ns;
};

/* Lowest and highest value of each measured signal. */
struct hydroboom_ranges {
    double of[HYDROBOOM_MACHINE_SIGNALS][2];
};

struct hydroboom_hello {
    uint32_t period_ns;
    uint16_t newest_version;
    uint8_t peer;
    uint8_t zero;
    uint64_t firmware; /* changed by the maker with the firmware; 0 where not stated */
};

struct hydroboom_measurement {
    uint64_t sampled_ns;
    uint8_t state;
    uint8_t zero;
    uint16_t fault;
    uint8_t zero_too[4];
};

/* Signals: stroke_m, pressure_pump_a_pa, pressure_a_pa, pressure_b_pa, pressure_pump_b_pa, pressure_accumulator_pa, motor_speed_rev_per_s. */
struct hydroboom_measured_axis {
    double signals[HYDROBOOM_MACHINE_SIGNALS];
    uint8_t validity[HYDROBOOM_MACHINE_SIGNALS];
    uint8_t valve;
};

struct hydroboom_command {
    uint8_t is_enabled;
    uint8_t zero[7];
};

struct hydroboom_commanded_axis {
    double motor_speed_rev_per_s;
    double holding_valve;
};

/* CRC-32 of zlib and Ethernet: the last four bytes of a datagram, of all before. */
static inline uint32_t hydroboom_crc32(const void *bytes, size_t length) {
    const unsigned char *at = (const unsigned char *)bytes;
    uint32_t sum = 0xffffffffu;
    for (size_t i = 0; i < length; i++) {
        sum ^= at[i];
        for (int bit = 0; bit < 8; bit++) {
            sum = (sum >> 1) ^ (0xedb88320u & (0u - (sum & 1u)));
        }
    }
    return ~sum;
}

#endif
