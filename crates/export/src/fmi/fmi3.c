/* FMI 3.0 for co-simulation, self-contained: types and functions are declared here with the standard's names. */
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#define HB_EXPORT __declspec(dllexport)
#else
#define HB_EXPORT __attribute__((visibility("default")))
#endif
#if defined(FMI3_FUNCTION_PREFIX)
#define HB_JOIN(a, b) a##b
#define HB_JOINED(a, b) HB_JOIN(a, b)
#define HB_NAME(name) HB_JOINED(FMI3_FUNCTION_PREFIX, name)
#else
#define HB_NAME(name) name
#endif

enum { HB_OK = 0, HB_WARNING = 1, HB_DISCARD = 2, HB_ERROR = 3, HB_FATAL = 4 };

typedef void (*hb_logger)(void *environment, int status, const char *category, const char *message);

#define hb_tell(i, status, text)                                                                   \
    do {                                                                                           \
        if ((i)->logger != NULL) {                                                                 \
            (i)->logger((i)->environment, (status), "logStatusError", (text));                     \
        }                                                                                          \
    } while (0)

HB_LAYER

HB_EXPORT const char *HB_NAME(fmi3GetVersion)(void)
{
    return "3.0";
}

HB_EXPORT int HB_NAME(fmi3SetDebugLogging)(void *c, bool on, size_t count, const char *const categories[])
{
    (void)c;
    (void)on;
    (void)count;
    (void)categories;
    return HB_OK;
}

HB_EXPORT void *HB_NAME(fmi3InstantiateCoSimulation)(const char *name, const char *token, const char *resources, bool visible,
    bool logging, bool events, bool early, const uint32_t required[], size_t count, void *environment, hb_logger logger,
    void (*update)(void))
{
    (void)resources;
    (void)visible;
    (void)logging;
    (void)events;
    (void)early;
    (void)required;
    (void)count;
    (void)update;
    if (name == NULL || token == NULL || strcmp(token, HB_TOKEN) != 0) {
        if (logger != NULL) {
            logger(environment, HB_ERROR, "logStatusError", "not instantiated: the token is not that of this FMU");
        }
        return NULL;
    }
    return hb_made(name, environment, logger);
}

HB_EXPORT void HB_NAME(fmi3FreeInstance)(void *c)
{
    free(c);
}

HB_EXPORT int HB_NAME(fmi3EnterInitializationMode)(void *c, bool has_tolerance, double tolerance, double start, bool has_stop, double stop)
{
    (void)has_tolerance;
    (void)tolerance;
    if (hb_allowed(c, HB_INSTANTIATED, "fmi3EnterInitializationMode") == 0 || hb_starts_at(c, start, has_stop, stop) != HB_OK) {
        return HB_ERROR;
    }
    ((hb_instance *)c)->now.mode = HB_INITIALIZING;
    return HB_OK;
}

HB_EXPORT int HB_NAME(fmi3ExitInitializationMode)(void *c)
{
    if (hb_allowed(c, HB_INITIALIZING, "fmi3ExitInitializationMode") == 0) {
        return HB_ERROR;
    }
    return hb_initialized(c);
}

HB_EXPORT int HB_NAME(fmi3EnterEventMode)(void *c)
{
    (void)c;
    return HB_ERROR;
}

HB_EXPORT int HB_NAME(fmi3EnterStepMode)(void *c)
{
    /* leaves event mode, which this FMU does not have: it can step as soon as it is initialized */
    return HB_STATUS(hb_allowed(c, 0, "fmi3EnterStepMode"));
}

HB_EXPORT int HB_NAME(fmi3Terminate)(void *c)
{
    return hb_terminated(c, "fmi3Terminate");
}

HB_EXPORT int HB_NAME(fmi3Reset)(void *c)
{
    return hb_reset(c);
}

HB_EXPORT int HB_NAME(fmi3GetFloat64)(void *c, const uint32_t vr[], size_t count, double values[], size_t value_count)
{
    return HB_STATUS(hb_allowed(c, HB_READABLE, "fmi3GetFloat64") != 0
        && hb_numbers_of(vr, count) == value_count
        && hb_get(c, vr, count, values) != 0);
}

HB_EXPORT int HB_NAME(fmi3SetFloat64)(void *c, const uint32_t vr[], size_t count, const double values[], size_t value_count)
{
    return HB_STATUS(hb_allowed(c, HB_BEFORE_STEPS | HB_STEPPING, "fmi3SetFloat64") != 0
        && hb_numbers_of(vr, count) == value_count
        && hb_set(c, vr, count, values) != 0);
}

/* The FMU has no variables of these types: only empty lists can be read or set. */
#define HB_NONE(name, type)                                                                        \
    HB_EXPORT int HB_NAME(name)(void *c, const uint32_t vr[], size_t count, type values[], size_t value_count) \
    {                                                                                              \
        (void)vr;                                                                                  \
        (void)values;                                                                              \
        return HB_STATUS(c != NULL && count == 0 && value_count == 0);                             \
    }
HB_NONE(fmi3GetFloat32, float)
HB_NONE(fmi3SetFloat32, const float)
HB_NONE(fmi3GetInt8, int8_t)
HB_NONE(fmi3SetInt8, const int8_t)
HB_NONE(fmi3GetUInt8, uint8_t)
HB_NONE(fmi3SetUInt8, const uint8_t)
HB_NONE(fmi3GetInt16, int16_t)
HB_NONE(fmi3SetInt16, const int16_t)
HB_NONE(fmi3GetUInt16, uint16_t)
HB_NONE(fmi3SetUInt16, const uint16_t)
HB_NONE(fmi3GetInt32, int32_t)
HB_NONE(fmi3SetInt32, const int32_t)
HB_NONE(fmi3GetUInt32, uint32_t)
HB_NONE(fmi3SetUInt32, const uint32_t)
HB_NONE(fmi3GetInt64, int64_t)
HB_NONE(fmi3SetInt64, const int64_t)
HB_NONE(fmi3GetUInt64, uint64_t)
HB_NONE(fmi3SetUInt64, const uint64_t)
HB_NONE(fmi3GetBoolean, bool)
HB_NONE(fmi3SetBoolean, const bool)
HB_NONE(fmi3GetString, const char *)
HB_NONE(fmi3SetString, const char *const)

HB_EXPORT int HB_NAME(fmi3GetFMUState)(void *c, void **state)
{
    return hb_copied((c != NULL) ? &((hb_instance *)c)->now : NULL, state);
}

HB_EXPORT int HB_NAME(fmi3SetFMUState)(void *c, void *state)
{
    return hb_restored(c, state);
}

HB_EXPORT int HB_NAME(fmi3FreeFMUState)(void *c, void **state)
{
    (void)c;
    return hb_released(state);
}

HB_EXPORT int HB_NAME(fmi3SerializedFMUStateSize)(void *c, void *state, size_t *size)
{
    (void)c;
    if (state == NULL || size == NULL) {
        return HB_ERROR;
    }
    *size = sizeof(hb_numbers);
    return HB_OK;
}

HB_EXPORT int HB_NAME(fmi3SerializeFMUState)(void *c, void *state, uint8_t bytes[], size_t size)
{
    (void)c;
    return hb_serialized(state, bytes, size);
}

HB_EXPORT int HB_NAME(fmi3DeserializeFMUState)(void *c, const uint8_t bytes[], size_t size, void **state)
{
    (void)c;
    return (size == sizeof(hb_numbers)) ? hb_copied(bytes, state) : HB_ERROR;
}

HB_EXPORT int HB_NAME(fmi3DoStep)(void *c, double time, double length, bool keeps, bool *event, bool *ends, bool *early, double *last)
{
    hb_instance *i = c;
    (void)keeps;
    if (i == NULL || event == NULL || ends == NULL || early == NULL || last == NULL) {
        return HB_ERROR;
    }
    *event = false;
    *ends = false;
    *early = false;
    *last = time;
    if (hb_allowed(i, HB_STEPPING, "fmi3DoStep") == 0 || hb_advance(i, time, length) == 0) {
        return HB_ERROR;
    }
    *last = i->now.time;
    return HB_OK;
}

HB_EXPORT int HB_NAME(fmi3GetDirectionalDerivative)(void *c, const uint32_t unknown[], size_t unknowns, const uint32_t known[],
    size_t knowns, const double direction[], size_t directions, double slopes[], size_t slope_count)
{
    return HB_STATUS(hb_allowed(c, HB_READABLE, "fmi3GetDirectionalDerivative") != 0 && directions == knowns && slope_count == unknowns
        && hb_along(c, unknown, unknowns, known, knowns, direction, slopes) != 0);
}

/* Other FMU types, not supported. */
HB_EXPORT void *HB_NAME(fmi3InstantiateModelExchange)(void)
{
    return NULL;
}

HB_EXPORT void *HB_NAME(fmi3InstantiateScheduledExecution)(void)
{
    return NULL;
}

/* Optional functions of the standard that this FMU declares as not supported. */
#define HB_ABSENT(name)                                                                            \
    HB_EXPORT int HB_NAME(name)(void)                                                              \
    {                                                                                              \
        return HB_ERROR;                                                                           \
    }
HB_ABSENT(fmi3GetBinary)
HB_ABSENT(fmi3SetBinary)
HB_ABSENT(fmi3GetClock)
HB_ABSENT(fmi3SetClock)
HB_ABSENT(fmi3GetNumberOfVariableDependencies)
HB_ABSENT(fmi3GetVariableDependencies)
HB_ABSENT(fmi3GetAdjointDerivative)
HB_ABSENT(fmi3EnterConfigurationMode)
HB_ABSENT(fmi3ExitConfigurationMode)
HB_ABSENT(fmi3GetIntervalDecimal)
HB_ABSENT(fmi3GetIntervalFraction)
HB_ABSENT(fmi3GetShiftDecimal)
HB_ABSENT(fmi3GetShiftFraction)
HB_ABSENT(fmi3SetIntervalDecimal)
HB_ABSENT(fmi3SetIntervalFraction)
HB_ABSENT(fmi3SetShiftDecimal)
HB_ABSENT(fmi3SetShiftFraction)
HB_ABSENT(fmi3EvaluateDiscreteStates)
HB_ABSENT(fmi3UpdateDiscreteStates)
HB_ABSENT(fmi3EnterContinuousTimeMode)
HB_ABSENT(fmi3CompletedIntegratorStep)
HB_ABSENT(fmi3SetTime)
HB_ABSENT(fmi3SetContinuousStates)
HB_ABSENT(fmi3GetContinuousStateDerivatives)
HB_ABSENT(fmi3GetEventIndicators)
HB_ABSENT(fmi3GetContinuousStates)
HB_ABSENT(fmi3GetNominalsOfContinuousStates)
HB_ABSENT(fmi3GetNumberOfEventIndicators)
HB_ABSENT(fmi3GetNumberOfContinuousStates)
HB_ABSENT(fmi3GetOutputDerivatives)
HB_ABSENT(fmi3ActivateModelPartition)
