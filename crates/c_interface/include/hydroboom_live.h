/* C interface of a simulated crane, for any language that can call C. One crane is used by one thread at a time; any
 * number of cranes may be open. No function ends the program. Functions that return int return 0 for success and 1 for
 * an error, whose text hydroboom_message gives. */
#ifndef HYDROBOOM_LIVE_H
#define HYDROBOOM_LIVE_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct hydroboom hydroboom;

/* A saved state of a crane, with its keys. */
typedef struct hydroboom_saved hydroboom_saved;

/* Opens a crane in equilibrium at the initial position of its file. `path`: a crane file, or NULL for the paper's crane.
 * `settings`: changed keys, one a line ("payload.mass_kg=340"), or NULL. Returns NULL on an error and writes the reason
 * to `message`, which has room for `size` bytes and may be NULL. */
hydroboom *hydroboom_open(const char *path, const char *settings, char *message, size_t size);

/* Simulates `duration_s` [s], a whole number of simulation periods of the crane file, with constant inputs: pump speed
 * [rev/s], positive for lifting, and 3/2 valve (1 energised, 0 load held). */
int hydroboom_advance(hydroboom *crane, double pump_speed_rev_s, double holding_valve, double duration_s);

/* Time since the start [s]. */
double hydroboom_time(const hydroboom *crane);

/* Number of outputs, and name and unit of each; NULL for an index out of range. */
size_t hydroboom_output_count(void);
const char *hydroboom_output_name(size_t output);
const char *hydroboom_output_unit(size_t output);

/* Writes all outputs to `values`, which has room for `count` numbers. */
int hydroboom_read(const hydroboom *crane, double values[], size_t count);

/* Number of states, which depends on the crane's number of segments, and the name of each with its unit
 * ("pressure_a_pa"); NULL for an index out of range. Names are valid until the crane is reset, restored or closed. */
size_t hydroboom_state_count(const hydroboom *crane);
const char *hydroboom_state_name(const hydroboom *crane, size_t state);

/* Writes all states to `values`, which has room for `count` numbers. */
int hydroboom_read_states(const hydroboom *crane, double values[], size_t count);

/* Writes one output ("pressure_a") or state ("pressure_a_pa"), by its name, to `value`. */
int hydroboom_value(const hydroboom *crane, const char *name, double *value);

/* Returns to equilibrium at the crane file's initial position and to time 0, with the current keys. On an error the crane
 * is unchanged. */
int hydroboom_reset(hydroboom *crane);

/* Saves state, time and keys; NULL on an error. The copy can be restored any number of times, to any crane, which then
 * continues exactly as this one would have. Release it with hydroboom_release. */
hydroboom_saved *hydroboom_save(const hydroboom *crane);
int hydroboom_restore(hydroboom *crane, const hydroboom_saved *saved);
void hydroboom_release(hydroboom_saved *saved);

/* Sets a key of the crane file during the simulation ("payload.mass_kg=120"). */
int hydroboom_set(hydroboom *crane, const char *assignment);

/* Error text of the last call on this crane; "" after success. Valid until the next call on it. */
const char *hydroboom_message(const hydroboom *crane);

void hydroboom_close(hydroboom *crane);

#ifdef __cplusplus
}
#endif

#endif
