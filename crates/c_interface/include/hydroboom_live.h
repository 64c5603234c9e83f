/* A simulated crane, live, from any language that calls C. A crane is used by one thread at a time; any number of cranes
 * may be open. Nothing here ends the program: what cannot be done is said. */
#ifndef HYDROBOOM_LIVE_H
#define HYDROBOOM_LIVE_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct hydroboom hydroboom;

/* A crane as it was when it was saved. */
typedef struct hydroboom_saved hydroboom_saved;

/* A crane at rest where its file says. `path`: a crane file, or NULL for the paper's crane. `settings`: keys to set otherwise,
 * one a line ("payload.mass_kg=340"), or NULL. NULL where there is no such crane; then the reason is in `message`, which
 * has room for `size` bytes and may be NULL. */
hydroboom *hydroboom_open(const char *path, const char *settings, char *message, size_t size);

/* Moves on: pump speed [rev/s], positive where it lifts; 3/2 valve (1 energised, 0 load held); duration [s], a whole number
 * of the crane file's simulation period. 0 where that went well. */
int hydroboom_advance(hydroboom *crane, double pump_speed_rev_s, double holding_valve, double duration_s);

/* Time since the start [s]. */
double hydroboom_time(const hydroboom *crane);

/* What can be seen: how many numbers, and name and unit of each, NULL beyond the last. */
size_t hydroboom_output_count(void);
const char *hydroboom_output_name(size_t output);
const char *hydroboom_output_unit(size_t output);

/* All of that now; `values` has room for `count` numbers. 0 where that went well. */
int hydroboom_read(const hydroboom *crane, double values[], size_t count);

/* What it remembers: how many numbers, and the name of each with its unit ("pressure_a_pa"), NULL beyond the last; it depends
 * on the crane's number of segments. Names are valid until a reset, a restored state or the crane's end. */
size_t hydroboom_state_count(const hydroboom *crane);
const char *hydroboom_state_name(const hydroboom *crane, size_t state);

/* All of that now; `values` has room for `count` numbers. 0 where that went well. */
int hydroboom_read_states(const hydroboom *crane, double values[], size_t count);

/* One of the outputs ("pressure_a") or states ("pressure_a_pa") by its name. 0 where there is one. */
int hydroboom_value(const hydroboom *crane, const char *name, double *value);

/* Back to rest where the crane file says, at time 0, with all keys as they are set now. 0 where that went well; otherwise the
 * crane stays as it is. */
int hydroboom_reset(hydroboom *crane);

/* A copy of the crane as it is now, time and keys included; NULL where there is none. It can be restored any number of times, to
 * any crane, after which that goes on exactly as this one would have; and is released in the end. */
hydroboom_saved *hydroboom_save(const hydroboom *crane);
int hydroboom_restore(hydroboom *crane, const hydroboom_saved *saved);
void hydroboom_release(hydroboom_saved *saved);

/* Sets a key of the crane file while the crane moves ("payload.mass_kg=120"). 0 where that went well. */
int hydroboom_set(hydroboom *crane, const char *assignment);

/* Why the last call on this crane did not go well; "" where none was. Valid until the next call on it. */
const char *hydroboom_message(const hydroboom *crane);

void hydroboom_close(hydroboom *crane);

#ifdef __cplusplus
}
#endif

#endif
