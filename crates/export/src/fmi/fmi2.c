/* FMI 2.0 for co-simulation, self-contained: types and functions are declared here with the standard's names. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#if defined(_WIN32)
#define HB_EXPORT __declspec(dllexport)
#else
#define HB_EXPORT __attribute__((visibility("default")))
#endif
#if defined(FMI2_FUNCTION_PREFIX)
#define HB_JOIN(a, b) a##b
#define HB_JOINED(a, b) HB_JOIN(a, b)
#define HB_NAME(name) HB_JOINED(FMI2_FUNCTION_PREFIX, name)
#else
#define HB_NAME(name) name
#endif

enum { HB_OK = 0, HB_WARNING = 1, HB_DISCARD = 2, HB_ERROR = 3, HB_FATAL = 4 };

typedef void (*hb_logger)(void *environment, const char *name, int status, const char *category, const char *message, ...);
typedef struct {
    hb_logger logger;
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
    void (*finished)(void *environment, int status);
    void *environment;
} hb_callbacks;

#define hb_tell(i, status, text)                                                                   \
    do {                                                                                           \
        if ((i)->logger != NULL) {                                                                 \
            (i)->logger((i)->environment, (i)->name, (status), "logStatusError", "%s", (text));    \
        }                                                                                          \
    } while (0)

HB_LAYER

HB_EXPORT const char *HB_NAME(fmi2GetTypesPlatform)(void)
{
    return "default";
}

HB_EXPORT const char *HB_NAME(fmi2GetVersion)(void)
{
    return "2.0";
}

HB_EXPORT int HB_NAME(fmi2SetDebugLogging)(void *c, int on, size_t count, const char *const categories[])
{
    (void)c;
    (void)on;
    (void)count;
    (void)categories;
    return HB_OK;
}

HB_EXPORT void *HB_NAME(fmi2Instantiate)(const char *name, int type, const char *token, const char *resources,
    const hb_callbacks *callbacks, int visible, int logging)
{
    (void)resources;
    (void)visible;
    (void)logging;
    if (name == NULL || token == NULL || strcmp(token, HB_TOKEN) != 0 || type != 1) {
        if (callbacks != NULL && callbacks->logger != NULL) {
            callbacks->logger(callbacks->environment, name != NULL ? name : "?", HB_ERROR, "logStatusError", "%s",
                "not instantiated: co-simulation only, and with the token of this FMU");
        }
        return NULL;
    }
    return hb_made(name, (callbacks != NULL) ? callbacks->environment : NULL, (callbacks != NULL) ? callbacks->logger : NULL);
}

HB_EXPORT void HB_NAME(fmi2FreeInstance)(void *c)
{
    free(c);
}

HB_EXPORT int HB_NAME(fmi2SetupExperiment)(void *c, int has_tolerance, double tolerance, double start, int has_stop, double stop)
{
    (void)has_tolerance;
    (void)tolerance;
    if (hb_allowed(c, HB_INSTANTIATED, "fmi2SetupExperiment") == 0) {
        return HB_ERROR;
    }
    return hb_starts_at(c, start, has_stop, stop);
}

HB_EXPORT int HB_NAME(fmi2EnterInitializationMode)(void *c)
{
    if (hb_allowed(c, HB_INSTANTIATED, "fmi2EnterInitializationMode") == 0) {
        return HB_ERROR;
    }
    ((hb_instance *)c)->now.mode = HB_INITIALIZING;
    return HB_OK;
}

HB_EXPORT int HB_NAME(fmi2ExitInitializationMode)(void *c)
{
    if (hb_allowed(c, HB_INITIALIZING, "fmi2ExitInitializationMode") == 0) {
        return HB_ERROR;
    }
    return hb_initialized(c);
}

HB_EXPORT int HB_NAME(fmi2Terminate)(void *c)
{
    return hb_terminated(c, "fmi2Terminate");
}

HB_EXPORT int HB_NAME(fmi2Reset)(void *c)
{
    return hb_reset(c);
}

HB_EXPORT int HB_NAME(fmi2GetReal)(void *c, const unsigned vr[], size_t count, double value[])
{
    return HB_STATUS(hb_allowed(c, HB_READABLE, "fmi2GetReal") != 0 && hb_get(c, vr, count, value) != 0);
}

HB_EXPORT int HB_NAME(fmi2SetReal)(void *c, const unsigned vr[], size_t count, const double value[])
{
    return HB_STATUS(hb_allowed(c, HB_BEFORE_STEPS | HB_STEPPING, "fmi2SetReal") != 0 && hb_set(c, vr, count, value) != 0);
}

/* The FMU has no variables of these types: only empty lists can be read or set. */
#define HB_NONE(name, type)                                                                        \
    HB_EXPORT int HB_NAME(name)(void *c, const unsigned vr[], size_t count, type value[])          \
    {                                                                                              \
        (void)vr;                                                                                  \
        (void)value;                                                                               \
        return HB_STATUS(c != NULL && count == 0);                                                 \
    }
HB_NONE(fmi2GetInteger, int)
HB_NONE(fmi2GetBoolean, int)
HB_NONE(fmi2GetString, const char *)
HB_NONE(fmi2SetInteger, const int)
HB_NONE(fmi2SetBoolean, const int)
HB_NONE(fmi2SetString, const char *const)

HB_EXPORT int HB_NAME(fmi2GetFMUstate)(void *c, void **state)
{
    return hb_copied((c != NULL) ? &((hb_instance *)c)->now : NULL, state);
}

HB_EXPORT int HB_NAME(fmi2SetFMUstate)(void *c, void *state)
{
    return hb_restored(c, state);
}

HB_EXPORT int HB_NAME(fmi2FreeFMUstate)(void *c, void **state)
{
    (void)c;
    return hb_released(state);
}

HB_EXPORT int HB_NAME(fmi2SerializedFMUstateSize)(void *c, void *state, size_t *size)
{
    (void)c;
    if (state == NULL || size == NULL) {
        return HB_ERROR;
    }
    *size = sizeof(hb_numbers);
    return HB_OK;
}

HB_EXPORT int HB_NAME(fmi2SerializeFMUstate)(void *c, void *state, char bytes[], size_t size)
{
    (void)c;
    return hb_serialized(state, bytes, size);
}

HB_EXPORT int HB_NAME(fmi2DeSerializeFMUstate)(void *c, const char bytes[], size_t size, void **state)
{
    (void)c;
    return (size == sizeof(hb_numbers)) ? hb_copied(bytes, state) : HB_ERROR;
}

HB_EXPORT int HB_NAME(fmi2DoStep)(void *c, double time, double length, int keeps)
{
    (void)keeps;
    return HB_STATUS(hb_allowed(c, HB_STEPPING, "fmi2DoStep") != 0 && hb_advance(c, time, length) != 0);
}

HB_EXPORT int HB_NAME(fmi2GetDirectionalDerivative)(void *c, const unsigned unknown[], size_t unknowns, const unsigned known[],
    size_t knowns, const double direction[], double slopes[])
{
    return HB_STATUS(hb_allowed(c, HB_READABLE, "fmi2GetDirectionalDerivative") != 0
        && hb_along(c, unknown, unknowns, known, knowns, direction, slopes) != 0);
}

HB_EXPORT int HB_NAME(fmi2CancelStep)(void *c)
{
    (void)c;
    return HB_ERROR;
}

HB_EXPORT int HB_NAME(fmi2GetRealStatus)(void *c, int kind, double *value)
{
    hb_instance *i = c;
    if (i == NULL || value == NULL || kind != 2) {
        return HB_DISCARD;
    }
    *value = i->now.time;
    return HB_OK;
}

/* Optional functions of the standard that this FMU declares as not supported. */
#define HB_ABSENT(name)                                                                            \
    HB_EXPORT int HB_NAME(name)(void)                                                              \
    {                                                                                              \
        return HB_ERROR;                                                                           \
    }
HB_ABSENT(fmi2SetRealInputDerivatives)
HB_ABSENT(fmi2GetRealOutputDerivatives)
HB_ABSENT(fmi2GetStatus)
HB_ABSENT(fmi2GetIntegerStatus)
HB_ABSENT(fmi2GetBooleanStatus)
HB_ABSENT(fmi2GetStringStatus)
HB_ABSENT(fmi2EnterEventMode)
HB_ABSENT(fmi2NewDiscreteStates)
HB_ABSENT(fmi2EnterContinuousTimeMode)
HB_ABSENT(fmi2CompletedIntegratorStep)
HB_ABSENT(fmi2SetTime)
HB_ABSENT(fmi2SetContinuousStates)
HB_ABSENT(fmi2GetDerivatives)
HB_ABSENT(fmi2GetEventIndicators)
HB_ABSENT(fmi2GetContinuousStates)
HB_ABSENT(fmi2GetNominalsOfContinuousStates)
