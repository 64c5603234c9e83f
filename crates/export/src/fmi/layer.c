/* What lies between the functions of an FMU and the block: numbers in one piece, that can be copied. */

typedef struct {
    HB_TYPE(parameters) p;
    HB_TYPE(prepared) c;
    HB_TYPE(input) u;
    HB_TYPE(state) s;
    HB_TYPE(output) y;
    double time;
    int is_prepared; /* what follows from the parameters is worked out */
    int has_begun;
    int is_broken; /* a step diverged */
} hb_numbers;

typedef struct {
    hb_numbers now;
    char name[64];
    void *environment;
    hb_logger logger;
} hb_instance;

/* What the block does; at the end of this file. */
static void hb_fill(hb_numbers *n);
static void hb_prepare(hb_numbers *n);
static void hb_one(hb_numbers *n);
static void hb_show(hb_numbers *n);
static double hb_period(const hb_numbers *n);
/* Steps of a simulated crane in one step of the block; 1 where there is none. */
static double hb_inner(const hb_numbers *n);

/* Parameters, inputs and states: what a slope can be along. */
#define HB_KNOWN (HB_PARAMETERS + HB_INPUTS + HB_STATES)

#if HB_RATES > 0
/* Rates of change, then the slopes of rates and outputs, from what is known and a seed for each of that. */
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

/* Numbers by reference: parameters, inputs, states, outputs, one after the other. */
static double *hb_place(hb_numbers *n, unsigned reference)
{
    if (reference < HB_PARAMETERS) {
        return (double *)&n->p + reference;
    }
    reference -= HB_PARAMETERS;
    if (reference < HB_INPUTS) {
        return (double *)&n->u + reference;
    }
    reference -= HB_INPUTS;
    if (reference < HB_STATES) {
        return (double *)&n->s + reference;
    }
    reference -= HB_STATES;
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

/* What is seen now, worked out anew where a number was changed. */
static void hb_refresh(hb_numbers *n)
{
    if (n->is_prepared == 0) {
        hb_prepare(n);
        n->is_prepared = 1;
    }
    hb_show(n);
}

static void hb_begin(hb_numbers *n)
{
    memset(n, 0, sizeof *n);
    hb_fill(n);
    hb_refresh(n);
}

/* Numbers read; 0 where one is not there. */
static int hb_get(hb_instance *i, const unsigned references[], size_t count, double values[])
{
    size_t k;
#if HB_RATES > 0
    double seen[HB_SEEN];
    int has_seen = 0;
#endif
    if (i->now.is_prepared == 0) {
        hb_refresh(&i->now);
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
        values[k] = *place;
    }
    return 1;
}

/* Parameters, inputs and states set; 0 where that is not possible, and then none is. */
static int hb_set(hb_instance *i, const unsigned references[], size_t count, const double values[])
{
    size_t k;
    for (k = 0; k < count; k++) {
        if (references[k] >= HB_KNOWN) {
            hb_say(i, HB_ERROR, "only parameters, inputs and states can be set");
            return 0;
        }
        if (!hb_is_finite(values[k])) {
            hb_say(i, HB_ERROR, "a value that is no number cannot be set");
            return 0;
        }
    }
    for (k = 0; k < count; k++) {
        *hb_place(&i->now, references[k]) = values[k];
        if (references[k] < HB_PARAMETERS || references[k] >= HB_PARAMETERS + HB_INPUTS) {
            i->now.is_prepared = 0;
        }
    }
    return 1;
}

/* As many steps as a communication step has; 0 where it diverged, or has no whole number of them. */
static int hb_advance(hb_instance *i, double time, double length)
{
    hb_numbers *n = &i->now;
    const double period = hb_period(n);
    const double count = floor(length / period + 0.5);
    const double inner = hb_inner(n);
    long steps;
    unsigned k;
    if (n->is_broken != 0) {
        hb_say(i, HB_ERROR, "an earlier step diverged: reset, or set a state from before");
        return 0;
    }
    if (!(period > 0.0) || !(count >= 1.0) || !(count < 1e9) || !(fabs(count * period - length) <= 1e-6 * period)) {
        hb_say(i, HB_ERROR, "the communication step is no multiple of the block's own step");
        return 0;
    }
    if (!(inner >= 0.5) || !(inner < 1e6) || !(fabs(floor(inner + 0.5) - inner) <= 1e-6)) {
        hb_say(i, HB_ERROR, "the control period is no multiple of the simulated crane's step");
        return 0;
    }
    if (n->is_prepared == 0) {
        hb_refresh(n);
    }
    for (steps = (long)count; steps > 0; steps--) {
        hb_one(n);
    }
    hb_show(n);
    n->time = time + length;
    for (k = 0; k < HB_STATES; k++) {
        if (!hb_is_finite(((double *)&n->s)[k])) {
            n->is_broken = 1;
            hb_say(i, HB_ERROR, "the simulation diverged: a state is no number any more; the step is too long, or an input impossible");
            return 0;
        }
    }
    return 1;
}

/* How outputs and rates change along a direction, given by what is known; 0 where one is no such thing. */
static int hb_along(hb_instance *i, const unsigned unknown[], size_t unknowns, const unsigned known[], size_t knowns,
    const double direction[], double slopes[])
{
#if HB_RATES > 0
    double seed[HB_KNOWN] = { 0.0 };
    double seen[HB_SEEN];
    size_t k;
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
        /* outputs stand before rates among the references, and behind them among the slopes */
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

/* What HB_OK and HB_ERROR say of something that is done or not. */
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

static int hb_starts_at(hb_instance *i, double start)
{
    if (i != NULL) {
        i->now.time = start;
    }
    return HB_STATUS(i != NULL);
}

static int hb_initialized(hb_instance *i)
{
    if (i != NULL) {
        hb_refresh(&i->now);
    }
    return HB_STATUS(i != NULL);
}

static int hb_reset(hb_instance *i)
{
    if (i != NULL) {
        hb_begin(&i->now);
    }
    return HB_STATUS(i != NULL);
}

/* Numbers copied to where they are kept, which is made where it is not there yet. */
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
