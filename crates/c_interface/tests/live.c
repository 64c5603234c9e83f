/* Two cranes, one heavier than the other, lifted alike; what cannot be done is said. Prints all outputs of the first. */
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
    hydroboom_close(light);
    hydroboom_close(heavy);
    hydroboom_close(NULL);
    return 0;
}
