/* Layer between the functions of an FMU and the block. All numbers are in one structure, which can be copied. */

/* States of the standard's state machine for an instance; each function is allowed in some of them. */
enum {
    HB_INSTANTIATED = 1,
    HB_INITIALIZING = 2,
    HB_STEPPING = 4,
    HB_FAILED = 8, /* a step diverged */
    HB_TERMINATED = 16
};
#define HB_BEFORE_STEPS (HB_INSTANTIATED | HB_INITIALIZING)
#define HB_READABLE (HB_INITIALIZING | HB_STEPPING | HB_FAILED | HB_TERMINATED)

typedef struct {
#if HB_PARAMETERS > 0
    HB_TYPE(parameters) p;
    HB_TYPE(prepared) c;
#endif
    HB_TYPE(input) u;
    HB_TYPE(state) s;
    HB_TYPE(output) y;
    double time;
    double stop;      /* stop time; HUGE_VAL if none is defined */
    double left;      /* accumulated rounding difference between communication steps and own steps */
    int mode;
    int is_prepared;  /* values derived from the parameters are up to date */
    int is_balanced;  /* the state is in equilibrium for these parameters, or was set by the user */
    int has_own_state; /* the user has set a state to a value other than the description's */
    int has_own_crane; /* the same for a parameter, before the first step */
    int has_begun;
    unsigned unusual; /* count of derived values that are not finite for the crane file's parameters */
} hb_numbers;

typedef struct {
    hb_numbers now;
    char name[64];
    void *environment;
    hb_logger logger;
} hb_instance;

/* A settable variable: name, minimum, maximum and nominal value. */
typedef struct {
    const char *name;
    double low;
    double high;
    double nominal;
} hb_bounds;

/* An array variable: reference of its first number, and their count. */
typedef struct {
    unsigned first;
    unsigned count;
} hb_array;

/* Functions of the block, defined at the end of this file. */
static void hb_fill(hb_numbers *n);
static void hb_prepare(hb_numbers *n);
static void hb_one(hb_numbers *n);
static void hb_show(hb_numbers *n);
static double hb_period(const hb_numbers *n);
/* Steps of a simulated crane in one step of the block; 1 without a simulated crane. */
static double hb_inner(const hb_numbers *n);
/* Error message for impossible parameters; NULL if they are possible. */
static const char *hb_impossible(const hb_numbers *n);
#if HB_BALANCES > 0
static void hb_restart(HB_TYPE(state) *s);
static void hb_balance(hb_numbers *n);
/* Whether equilibrium needs a pressure below vapour pressure. */
static int hb_pulls(const hb_numbers *n);
#endif

/* Parameters, inputs and states: the variables of directional derivatives. */
#define HB_KNOWN (HB_PARAMETERS + HB_INPUTS + HB_STATES)

static const hb_bounds hb_known_bounds[HB_KNOWN] = {
HB_BOUNDS_OF_KNOWN
};

#if HB_ARRAYS > 0
static const hb_array hb_arrays[HB_ARRAYS] = {
HB_ROWS_OF_ARRAYS
};
#endif

/* Count of numbers of a variable. */
static size_t hb_size(unsigned reference)
{
#if HB_ARRAYS > 0
    unsigned k;
    for (k = 0; k < HB_ARRAYS; k++) {
        if (hb_arrays[k].first == reference) {
            return hb_arrays[k].count;
        }
    }
#else
    (void)reference;
#endif
    return 1;
}

#if HB_RATES > 0
/* Rates of the states, then the directional derivatives of rates and outputs, from the variables and a seed for each. */
static void hb_slopes(const double given[], double seen[]);
#define HB_SEEN (2u * HB_RATES + HB_OUTPUTS)

static void hb_rates_and_slopes(const hb_numbers *n, const double seed[], double seen[])
{
    double given[2u * HB_KNOWN];
    memcpy(given, &n->p, HB_PARAMETERS * sizeof(double));
    memcpy(given + HB_PARAMETERS, &n->u, HB_INPUTS * sizeof(double));
    memcpy(given + HB_PARAMETERS + HB_INPUTS, &n->s, HB_STATES * sizeof(double));
    memcpy(given + HB_KNOWN, seed, HB_KNOWN * sizeof(double));
    hb_slopes(given, seen);
}
#endif

static int hb_is_parameter(unsigned reference)
{
#if HB_PARAMETERS > 0
    return reference < HB_PARAMETERS;
#else
    (void)reference;
    return 0;
#endif
}

static int hb_is_input(unsigned reference)
{
    return !hb_is_parameter(reference) && reference < HB_PARAMETERS + HB_INPUTS;
}

/* Numbers by reference: parameters, inputs, states, outputs, one after the other. */
static double *hb_place(hb_numbers *n, unsigned reference)
{
#if HB_PARAMETERS > 0
    if (reference < HB_PARAMETERS) {
        return (double *)&n->p + reference;
    }
    reference -= HB_PARAMETERS;
#endif
    if (reference < HB_INPUTS) {
        return (double *)&n->u + reference;
    }
    reference -= HB_INPUTS;
#if HB_STATES > 0
    if (reference < HB_STATES) {
        return (double *)&n->s + reference;
    }
    reference -= HB_STATES;
#endif
    return (reference < HB_OUTPUTS) ? (double *)&n->y + reference : NULL;
}

static int hb_is_finite(double value)
{
    return value - value < 1.0;
}

static void hb_say(hb_instance *i, int status, const char *text)
{
    hb_tell(i, status, text);
}

/* Whether a function is allowed in the current state. */
static int hb_allowed(hb_instance *i, int modes, const char *function)
{
    const char *now = "after termination";
    char text[160];
    if (i == NULL) {
        return 0;
    }
    if ((i->now.mode & modes) != 0) {
        return 1;
    }
    switch (i->now.mode) {
    case HB_INSTANTIATED:
        now = "before initialization";
        break;
    case HB_INITIALIZING:
        now = "in initialization mode";
        break;
    case HB_STEPPING:
        now = "between steps";
        break;
    case HB_FAILED:
        now = "after a step that diverged: reset, or set a state from before";
        break;
    default:
        break;
    }
    snprintf(text, sizeof text, "%s is not allowed %s", function, now);
    hb_say(i, HB_ERROR, text);
    return 0;
}

static unsigned hb_unusual(const hb_numbers *n)
{
    unsigned count = 0;
#if HB_PARAMETERS > 0
    size_t k;
    for (k = 0; k < sizeof n->c / sizeof(double); k++) {
        count += (hb_is_finite(((const double *)&n->c)[k]) != 0) ? 0u : 1u;
    }
#else
    (void)n;
#endif
    return count;
}

#if HB_BALANCES > 0
/* Largest number of Newton steps to equilibrium; three to seven are usual. */
#define HB_MOST_ROUNDS 50
/* Convergence: largest change in the last step, relative to the nominal value; rounding is about 1e-15. */
#define HB_SETTLED 1e-9

/* Computes the equilibrium for the parameters, starting from that of the crane file; 0 if there is none. */
static int hb_rests(hb_numbers *n)
{
    double change = HUGE_VAL;
    int round;
    hb_restart(&n->s);
    for (round = 0; round < HB_MOST_ROUNDS && change != 0.0; round++) {
        const HB_TYPE(state) before = n->s;
        unsigned k;
        hb_balance(n);
        change = 0.0;
        for (k = 0; k < HB_STATES; k++) {
            const double by = fabs(((const double *)&n->s)[k] - ((const double *)&before)[k]);
            const double share = by / hb_known_bounds[HB_PARAMETERS + HB_INPUTS + k].nominal;
            if (!hb_is_finite(share)) {
                return 0;
            }
            change = (share > change) ? share : change;
        }
    }
    return change <= HB_SETTLED;
}

/* Whether all states are within their ranges. */
static int hb_is_within(const hb_numbers *n)
{
    unsigned k;
    for (k = 0; k < HB_STATES; k++) {
        const hb_bounds *of = &hb_known_bounds[HB_PARAMETERS + HB_INPUTS + k];
        const double value = ((const double *)&n->s)[k];
        if (!(value >= of->low && value <= of->high)) {
            return 0;
        }
    }
    return 1;
}
#endif

/* Recomputes derived values and outputs after a change; 0 if the numbers are impossible. */
static int hb_refreshed(hb_instance *i)
{
    hb_numbers *n = &i->now;
    const char *wrong;
    if (n->is_prepared != 0) {
        return 1;
    }
    hb_prepare(n);
    wrong = hb_impossible(n);
    if (wrong == NULL && hb_unusual(n) > n->unusual) {
        wrong = "a number that follows from the parameters is not finite";
    }
#if HB_BALANCES > 0
    if (wrong == NULL && n->is_balanced == 0) {
        if (hb_rests(n) == 0) {
            wrong = "boom and payload find no static balance at motion_start_mm";
        } else if (hb_pulls(n) != 0) {
            wrong = "the load would have to be held by suction, below vapour pressure";
        } else if (hb_is_within(n) == 0) {
            wrong = "the crane would rest outside of what its states may be: the load is too heavy for the cylinder";
        }
    }
#endif
    if (wrong != NULL) {
        hb_say(i, HB_ERROR, wrong);
        return 0;
    }
    n->is_balanced = 1;
    n->is_prepared = 1;
    hb_show(n);
    return 1;
}

/* Initial values of an instance, from the crane file. */
static void hb_begin(hb_numbers *n)
{
    memset(n, 0, sizeof *n);
    n->mode = HB_INSTANTIATED;
    n->stop = HUGE_VAL;
    hb_fill(n);
    hb_prepare(n);
    n->unusual = hb_unusual(n);
    n->is_prepared = 1;
    n->is_balanced = 1;
    hb_show(n);
}

/* Total count of numbers of some variables. */
static size_t hb_numbers_of(const unsigned references[], size_t count)
{
    size_t all = 0;
    size_t k;
    for (k = 0; references != NULL && k < count; k++) {
        all += hb_size(references[k]);
    }
    return all;
}

/* Reads variables, arrays entry by entry; 0 if a reference is unknown. */
static int hb_get(hb_instance *i, const unsigned references[], size_t count, double values[])
{
    size_t k;
    size_t at = 0;
#if HB_RATES > 0
    double seen[HB_SEEN];
    int has_seen = 0;
#endif
    if (count > 0 && (references == NULL || values == NULL)) {
        hb_say(i, HB_ERROR, "there is no place to read from or to");
        return 0;
    }
    if (hb_refreshed(i) == 0) {
        return 0;
    }
    for (k = 0; k < count; k++) {
        const double *place = hb_place(&i->now, references[k]);
#if HB_RATES > 0
        if (place == NULL && references[k] - HB_KNOWN - HB_OUTPUTS < HB_RATES) {
            if (has_seen == 0) {
                const double seed[HB_KNOWN] = { 0.0 };
                hb_rates_and_slopes(&i->now, seed, seen);
                has_seen = 1;
            }
            place = seen + (references[k] - HB_KNOWN - HB_OUTPUTS);
        }
#endif
        if (references[k] == HB_KNOWN + HB_OUTPUTS + HB_RATES) {
            place = &i->now.time;
        }
        if (place == NULL) {
            hb_say(i, HB_ERROR, "there is no variable with this value reference");
            return 0;
        }
        memcpy(values + at, place, hb_size(references[k]) * sizeof(double));
        at += hb_size(references[k]);
    }
    return 1;
}

/* Whether a value is allowed for a variable. */
static int hb_settable(hb_instance *i, unsigned reference, double value)
{
    const hb_bounds *of;
    char text[200];
    if (reference >= HB_KNOWN) {
        hb_say(i, HB_ERROR, "only parameters, inputs and states can be set");
        return 0;
    }
    of = &hb_known_bounds[reference];
    if (!hb_is_parameter(reference) && !hb_is_input(reference) && (i->now.mode & HB_BEFORE_STEPS) == 0) {
        snprintf(text, sizeof text, "%s can be set before and in initialization mode only", of->name);
    } else if (HB_FRAMED && hb_is_input(reference)) {
        /* the frame around the controller checks its inputs, and reports by its status */
        return 1;
    } else if (!hb_is_finite(value)) {
        snprintf(text, sizeof text, "%s cannot be set to a value that is no number", of->name);
    } else if (value < of->low || value > of->high) {
        snprintf(text, sizeof text, "%s = %.9g is outside of its range, %.9g to %.9g", of->name, value, of->low, of->high);
    } else {
        return 1;
    }
    hb_say(i, HB_ERROR, text);
    return 0;
}

/* Whether a state's value differs from the description's, which some masters set by themselves. */
static int hb_is_own(unsigned state, double value)
{
#if HB_BALANCES > 0
    HB_TYPE(state) first;
    hb_restart(&first);
    return value != ((const double *)&first)[state];
#else
    (void)state;
    (void)value;
    return 1;
#endif
}

/* Sets parameters, inputs and states: all of them, or none and 0 if one is not allowed. */
static int hb_set(hb_instance *i, const unsigned references[], size_t count, const double values[])
{
    hb_numbers *n = &i->now;
    const int is_before = (n->mode & HB_BEFORE_STEPS) != 0;
    size_t at = 0;
    size_t k;
    size_t entry;
    if (count > 0 && (references == NULL || values == NULL)) {
        hb_say(i, HB_ERROR, "there is no place to read from");
        return 0;
    }
    for (k = 0; k < count; k++) {
        for (entry = hb_size(references[k]); entry > 0; entry--) {
            if (hb_settable(i, references[k], values[at++]) == 0) {
                return 0;
            }
        }
    }
    at = 0;
    for (k = 0; k < count; k++) {
        double *place = hb_place(n, references[k]);
        const double value = values[at];
        const int is_changed = *place != value;
        memcpy(place, values + at, hb_size(references[k]) * sizeof(double));
        at += hb_size(references[k]);
        if (is_changed == 0 || hb_is_input(references[k])) {
            continue;
        }
        n->is_prepared = 0;
        if (hb_is_parameter(references[k])) {
            n->has_own_crane |= is_before;
        } else {
            n->has_own_state |= hb_is_own(references[k] - HB_PARAMETERS - HB_INPUTS, value);
        }
        /* changed parameters change the equilibrium; a state set by the user is kept */
        n->is_balanced = !is_before || !n->has_own_crane || n->has_own_state;
    }
    return 1;
}

/* Tolerance for times: a millionth of a step plus the rounding of numbers of this size. */
static double hb_rounding(double period, double time, double length)
{
    const double unit = 2.220446049250313e-16; /* machine epsilon */
    return 1e-6 * period + 8.0 * unit * (fabs(time) + fabs(length));
}

/* Executes the own steps of a communication step; 0 if it diverges or is not a multiple of the own step. Rounding
 * differences are summed, so that they stay below the tolerance over any number of steps. */
static int hb_advance(hb_instance *i, double time, double length)
{
    hb_numbers *n = &i->now;
    const double period = hb_period(n);
    const double inner = hb_inner(n);
    const double slack = hb_rounding(period, time, length);
    const double count = floor((length + n->left) / period + 0.5);
    const double left = (length + n->left) - count * period;
    long steps;
    unsigned k;
    if (!(length > 0.0) || !(period > 0.0) || !(count >= 1.0) || !(count < 1e9) || !(fabs(left) <= slack)) {
        hb_say(i, HB_ERROR, "the communication step is no multiple of the block's own step");
        return 0;
    }
    if (!(fabs(time - n->time) <= slack)) {
        hb_say(i, HB_ERROR, "the communication point is not the end of the last step");
        return 0;
    }
    if (!(inner >= 0.5) || !(inner < 1e6) || !(fabs(floor(inner + 0.5) - inner) <= 1e-6)) {
        hb_say(i, HB_ERROR, "the control period is no multiple of the simulated crane's step");
        return 0;
    }
    if (time + length > n->stop + slack) {
        hb_say(i, HB_ERROR, "the communication step goes beyond the stop time");
        return 0;
    }
    if (hb_refreshed(i) == 0) {
        return 0;
    }
    for (steps = (long)count; steps > 0; steps--) {
        hb_one(n);
    }
    hb_show(n);
    n->time = time + length;
    n->left = left;
    /* the frame around a controller checks itself, and reports by its status */
    for (k = 0; HB_FRAMED == 0 && k < sizeof n->s / sizeof(double); k++) {
        if (!hb_is_finite(((double *)&n->s)[k])) {
            n->mode = HB_FAILED;
            hb_say(i, HB_ERROR, "the simulation diverged: a state is no number any more; the step is too long, or an input impossible");
            return 0;
        }
    }
    return 1;
}

/* Directional derivatives of outputs and rates along a direction of known variables; 0 if a reference does not fit. */
static int hb_along(hb_instance *i, const unsigned unknown[], size_t unknowns, const unsigned known[], size_t knowns,
    const double direction[], double slopes[])
{
#if HB_RATES > 0
    double seed[HB_KNOWN] = { 0.0 };
    double seen[HB_SEEN];
    size_t k;
    if ((knowns > 0 && (known == NULL || direction == NULL)) || (unknowns > 0 && (unknown == NULL || slopes == NULL))) {
        hb_say(i, HB_ERROR, "there is no place to read from or to");
        return 0;
    }
    if (hb_refreshed(i) == 0) {
        return 0;
    }
    for (k = 0; k < knowns; k++) {
        if (known[k] >= HB_KNOWN) {
            hb_say(i, HB_ERROR, "slopes are along parameters, inputs and states");
            return 0;
        }
        seed[known[k]] += direction[k];
    }
    hb_rates_and_slopes(&i->now, seed, seen);
    for (k = 0; k < unknowns; k++) {
        if (unknown[k] < HB_KNOWN || unknown[k] >= HB_KNOWN + HB_OUTPUTS + HB_RATES) {
            hb_say(i, HB_ERROR, "slopes are those of outputs and rates of change");
            return 0;
        }
        /* outputs come before rates in the references, and after them in the derivatives */
        slopes[k] = (unknown[k] < HB_KNOWN + HB_OUTPUTS) ? seen[2u * HB_RATES + unknown[k] - HB_KNOWN]
                                                         : seen[HB_RATES + unknown[k] - HB_KNOWN - HB_OUTPUTS];
    }
    return 1;
#else
    (void)unknown;
    (void)unknowns;
    (void)known;
    (void)knowns;
    (void)direction;
    (void)slopes;
    hb_say(i, HB_ERROR, "this FMU gives no directional derivatives");
    return 0;
#endif
}

/* Status of a success or a failure. */
#define HB_STATUS(done) ((done) != 0 ? HB_OK : HB_ERROR)

static hb_instance *hb_made(const char *name, void *environment, hb_logger logger)
{
    hb_instance *i = calloc(1, sizeof *i);
    if (i != NULL) {
        strncpy(i->name, name, sizeof i->name - 1);
        i->logger = logger;
        i->environment = environment;
        hb_begin(&i->now);
    }
    return i;
}

/* Sets start and stop time. */
static int hb_starts_at(hb_instance *i, double start, int has_stop, double stop)
{
    if (!hb_is_finite(start) || (has_stop != 0 && !(stop >= start))) {
        hb_say(i, HB_ERROR, "the start time is no number, or the stop time before it");
        return HB_ERROR;
    }
    i->now.time = start;
    i->now.stop = (has_stop != 0) ? stop : HUGE_VAL;
    return HB_OK;
}

static int hb_initialized(hb_instance *i)
{
    if (hb_refreshed(i) == 0) {
        return HB_ERROR;
    }
    i->now.mode = HB_STEPPING;
    return HB_OK;
}

static int hb_terminated(hb_instance *i, const char *function)
{
    if (hb_allowed(i, HB_STEPPING | HB_FAILED, function) == 0) {
        return HB_ERROR;
    }
    i->now.mode = HB_TERMINATED;
    return HB_OK;
}

static int hb_reset(hb_instance *i)
{
    if (i != NULL) {
        hb_begin(&i->now);
    }
    return HB_STATUS(i != NULL);
}

/* Copies the numbers to a saved state, which is allocated if it does not exist. */
static int hb_copied(const void *numbers, void **state)
{
    if (numbers == NULL || state == NULL) {
        return HB_ERROR;
    }
    if (*state == NULL) {
        *state = malloc(sizeof(hb_numbers));
    }
    if (*state == NULL) {
        return HB_ERROR;
    }
    memcpy(*state, numbers, sizeof(hb_numbers));
    return HB_OK;
}

static int hb_restored(hb_instance *i, const void *state)
{
    if (i == NULL || state == NULL) {
        return HB_ERROR;
    }
    memcpy(&i->now, state, sizeof i->now);
    return HB_OK;
}

static int hb_released(void **state)
{
    if (state != NULL) {
        free(*state);
        *state = NULL;
    }
    return HB_OK;
}

static int hb_serialized(const void *state, void *bytes, size_t size)
{
    if (state == NULL || bytes == NULL || size < sizeof(hb_numbers)) {
        return HB_ERROR;
    }
    memcpy(bytes, state, sizeof(hb_numbers));
    return HB_OK;
}
