/* A simulated crane, live, from any language that calls C. A crane is used by one thread at a time; any number of cranes
 * may be open. Nothing here ends the program: what cannot be done is said. */
#ifndef HYDROBOOM_LIVE_H
#define HYDROBOOM_LIVE_H

#include <stddef.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct hydroboom hydroboom;

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

/* Sets a key of the crane file while the crane moves ("payload.mass_kg=120"). 0 where that went well. */
int hydroboom_set(hydroboom *crane, const char *assignment);

/* Why the last call on this crane did not go well; "" where none was. Valid until the next call on it. */
const char *hydroboom_message(const hydroboom *crane);

void hydroboom_close(hydroboom *crane);

#ifdef __cplusplus
}
#endif

#endif
