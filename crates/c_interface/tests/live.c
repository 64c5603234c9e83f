/* Two cranes, one heavier than the other, with the same inputs; checks error messages. Prints all outputs of the first. */
#include "hydroboom_live.h"
#include <stdio.h>
#include <string.h>

int main(void)
{
    char why[200];
    double seen[64];
    double other[64];
    size_t k;
    const size_t count = hydroboom_output_count();
    hydroboom *light = hydroboom_open(NULL, NULL, why, sizeof why);
    hydroboom *heavy = hydroboom_open(NULL, "payload.mass_kg=400\n\n", NULL, 0);
    if (light == NULL || heavy == NULL || count > 64u) {
        return 1;
    }
    for (k = 0; k < 500u; k++) {
        if (hydroboom_advance(light, 10.0, 1.0, 1e-3) != 0 || hydroboom_advance(heavy, 10.0, 1.0, 1e-3) != 0) {
            return 2;
        }
    }
    if (hydroboom_read(light, seen, count) != 0 || hydroboom_read(heavy, other, count) != 0) {
        return 3;
    }
    for (k = 0; k < count; k++) {
        printf("%s %.17g\n", hydroboom_output_name(k), seen[k]);
        if (strcmp(hydroboom_output_name(k), "pressure_a") == 0 && !(other[k] > seen[k] + 5e5)) {
            return 4;
        }
    }
    if (hydroboom_output_name(count) != NULL || hydroboom_output_unit(count) != NULL) {
        return 5;
    }
    if (hydroboom_set(heavy, "payload.mass_kg=ten") == 0 || strstr(hydroboom_message(heavy), "ten") == NULL) {
        return 6;
    }
    if (hydroboom_set(heavy, "payload.mass_kg=100") != 0 || strlen(hydroboom_message(heavy)) != 0u) {
        return 7;
    }
    if (hydroboom_advance(light, 10.0, 1.0, 1.23456e-3) == 0 || strstr(hydroboom_message(light), "whole number") == NULL) {
        return 8;
    }
    if (hydroboom_advance(light, 0.0 / 0.0, 1.0, 1e-3) == 0 || hydroboom_advance(NULL, 0.0, 1.0, 1e-3) == 0) {
        return 9;
    }
    if (hydroboom_open("no such file.toml", NULL, why, 12) != NULL || strlen(why) != 11u) {
        return 10;
    }
    if (hydroboom_read(light, seen, count - 1u) == 0 || hydroboom_read(light, NULL, count) == 0) {
        return 11;
    }
    /* states, by index and by name */
    {
        double states[64];
        double value = 0.0;
        const size_t states_here = hydroboom_state_count(light);
        if (states_here == 0u || states_here > 64u || hydroboom_read_states(light, states, states_here) != 0) {
            return 12;
        }
        for (k = 0; k < states_here; k++) {
            if (hydroboom_value(light, hydroboom_state_name(light, k), &value) != 0 || value != states[k]) {
                return 13;
            }
        }
        for (k = 0; k < count; k++) {
            if (hydroboom_value(light, hydroboom_output_name(k), &value) != 0 || value != seen[k]) {
                return 14;
            }
        }
        if (hydroboom_state_name(light, states_here) != NULL || hydroboom_value(light, "no such", &value) == 0) {
            return 15;
        }
        if (hydroboom_value(NULL, "stroke", &value) == 0 || hydroboom_value(light, NULL, &value) == 0
            || hydroboom_value(light, "stroke", NULL) == 0 || hydroboom_read_states(NULL, states, 64u) == 0
            || hydroboom_read_states(light, NULL, 64u) == 0 || hydroboom_read_states(light, states, states_here - 1u) == 0
            || hydroboom_state_count(NULL) != 0u || hydroboom_state_name(NULL, 0u) != NULL) {
            return 16;
        }
    }
    /* a saved state goes on as it did, on another crane too; a reset is where it began */
    {
        double first[64];
        double start[64];
        hydroboom *fresh = hydroboom_open(NULL, NULL, NULL, 0);
        hydroboom_saved *saved = hydroboom_save(light);
        if (fresh == NULL || saved == NULL || hydroboom_read(fresh, start, count) != 0) {
            return 17;
        }
        for (k = 0; k < 100u; k++) {
            hydroboom_advance(light, -5.0, 1.0, 1e-3);
        }
        hydroboom_read(light, first, count);
        if (hydroboom_restore(light, saved) != 0 || hydroboom_restore(heavy, saved) != 0
            || hydroboom_time(heavy) != hydroboom_time(light)) {
            return 18;
        }
        hydroboom_release(saved);
        for (k = 0; k < 100u; k++) {
            hydroboom_advance(light, -5.0, 1.0, 1e-3);
            hydroboom_advance(heavy, -5.0, 1.0, 1e-3);
        }
        hydroboom_read(light, seen, count);
        hydroboom_read(heavy, other, count);
        if (memcmp(first, seen, count * sizeof(double)) != 0 || memcmp(first, other, count * sizeof(double)) != 0) {
            return 19;
        }
        if (hydroboom_reset(light) != 0 || hydroboom_time(light) != 0.0 || hydroboom_read(light, seen, count) != 0
            || memcmp(start, seen, count * sizeof(double)) != 0) {
            return 20;
        }
        if (hydroboom_reset(NULL) == 0 || hydroboom_save(NULL) != NULL || hydroboom_restore(light, NULL) == 0
            || strstr(hydroboom_message(light), "no saved state") == NULL || hydroboom_restore(NULL, NULL) == 0) {
            return 21;
        }
        hydroboom_release(NULL);
        hydroboom_close(fresh);
    }
    hydroboom_close(light);
    hydroboom_close(heavy);
    hydroboom_close(NULL);
    return 0;
}
