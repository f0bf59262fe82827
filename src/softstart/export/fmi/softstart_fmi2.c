/* The functions of FMI 2.0 for co-simulation; those of model exchange are refused. */

#include "softstart_fmu.c"

#if defined(FMI2_FUNCTION_PREFIX)
#define NAMED(name) JOINED(FMI2_FUNCTION_PREFIX, name)
#else
#define NAMED(name) name
#endif
#define EXPORTED(result, name) VISIBLE result NAMED(name)

enum { CO_SIMULATION = 1 };                                                    /* kind of an FMU */
enum { DO_STEP_STATUS, PENDING_STATUS, LAST_SUCCESSFUL_TIME, TERMINATED_STATUS }; /* kind of a status */

/* What the importer gives at the beginning. */
typedef struct {
    void (*logger)(void *environment, const char *name, Status status, const char *category, const char *message, ...);
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
    void (*step_finished)(void *environment, Status status);
    void *environment;
} Callbacks;

typedef struct {
    int new_discrete_states_needed, terminate_simulation, nominals_changed, values_changed, next_event_time_defined;
    double next_event_time;
} EventInfo;

typedef uint32_t Reference;

static void log_message(const Instance *instance, Status status, const char *message)
{
    const Callbacks *callbacks = instance->callback;
    if (callbacks->logger != NULL) {
        callbacks->logger(instance->environment, instance->name, status,
                          status == DISCARD ? "logStatusDiscard" : "logStatusError", message);
    }
}

EXPORTED(const char *, fmi2GetTypesPlatform)(void) { return "default"; }
EXPORTED(const char *, fmi2GetVersion)(void) { return "2.0"; }

EXPORTED(Status, fmi2SetDebugLogging)(Instance *instance, int on, size_t count, const char *const categories[])
{
    (void)count, (void)categories;
    instance->logging = on != 0;
    return OK;
}

EXPORTED(Instance *, fmi2Instantiate)(const char *name, int kind, const char *token, const char *resources,
                                      const Callbacks *callbacks, int visible, int logging)
{
    (void)resources, (void)visible;
    if (callbacks == NULL) {
        return NULL;
    }
    Instance draft = {0};
    draft.logging = true; /* why an FMU cannot be instantiated is told in any case */
    draft.name = name == NULL ? "" : name;
    draft.environment = callbacks->environment;
    draft.log = log_message;
    draft.callback = (void *)(uintptr_t)callbacks;
    draft.allocate = callbacks->allocate == NULL ? calloc : callbacks->allocate;
    draft.release = callbacks->allocate == NULL || callbacks->release == NULL ? free : callbacks->release;
    if (kind != CO_SIMULATION) {
        report(&draft, ERROR, "this FMU is for co-simulation only.");
        return NULL;
    }
    Instance *instance = create(&draft, token, name);
    if (instance != NULL) {
        instance->logging = logging != 0;
    }
    return instance;
}

EXPORTED(void, fmi2FreeInstance)(Instance *instance) { destroy(instance); }

EXPORTED(Status, fmi2SetupExperiment)(Instance *instance, int tolerance_defined, double tolerance, double start,
                                      int stop_defined, double stop)
{
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    if (instance->memory.mode != INSTANTIATED) {
        return report(instance, ERROR, "the experiment is set up after the initialization has begun.");
    }
    instance->memory.time = start;
    return OK;
}

EXPORTED(Status, fmi2EnterInitializationMode)(Instance *instance) { return enter_initialization(instance); }
EXPORTED(Status, fmi2ExitInitializationMode)(Instance *instance) { return exit_initialization(instance); }
EXPORTED(Status, fmi2Terminate)(Instance *instance) { return terminate(instance); }

EXPORTED(Status, fmi2Reset)(Instance *instance)
{
    begin(instance);
    return OK;
}

#define GET_FUNCTION(name, type, kind)                                                                           \
    EXPORTED(Status, name)(Instance *instance, const Reference references[], size_t count, type values[])        \
    {                                                                                                            \
        for (size_t i = 0; i < count; i++) {                                                                     \
            double value = 0.0;                                                                                  \
            if (get_number(instance, references[i], kind, &value) != OK) {                                       \
                return ERROR;                                                                                    \
            }                                                                                                    \
            values[i] = (type)value;                                                                             \
        }                                                                                                        \
        return OK;                                                                                               \
    }

/* All references are looked at first: a call that is refused sets nothing. */
#define SET_FUNCTION(name, type, kind)                                                                           \
    EXPORTED(Status, name)(Instance *instance, const Reference references[], size_t count, const type values[])  \
    {                                                                                                            \
        for (size_t i = 0; i < count; i++) {                                                                     \
            if (settable(instance, references[i], kind) != OK) {                                                 \
                return ERROR;                                                                                    \
            }                                                                                                    \
        }                                                                                                        \
        for (size_t i = 0; i < count; i++) {                                                                     \
            set_number(instance, references[i], values[i]);                                                      \
        }                                                                                                        \
        return OK;                                                                                               \
    }

GET_FUNCTION(fmi2GetReal, double, KIND_DOUBLE)
GET_FUNCTION(fmi2GetInteger, int, KIND_WHOLE)
GET_FUNCTION(fmi2GetBoolean, int, KIND_TRUTH)
SET_FUNCTION(fmi2SetReal, double, KIND_DOUBLE)
SET_FUNCTION(fmi2SetInteger, int, KIND_WHOLE)
SET_FUNCTION(fmi2SetBoolean, int, KIND_TRUTH)

EXPORTED(Status, fmi2GetString)(Instance *instance, const Reference references[], size_t count, const char *values[])
{
    (void)references, (void)values;
    return count == 0 ? OK : unsupported(instance, "fmi2GetString");
}

EXPORTED(Status, fmi2SetString)(Instance *instance, const Reference references[], size_t count,
                                const char *const values[])
{
    (void)references, (void)values;
    return count == 0 ? OK : unsupported(instance, "fmi2SetString");
}

EXPORTED(Status, fmi2GetFMUstate)(Instance *instance, void **state) { return copy_state(instance, state); }
EXPORTED(Status, fmi2SetFMUstate)(Instance *instance, void *state) { return restore_state(instance, state); }
EXPORTED(Status, fmi2FreeFMUstate)(Instance *instance, void **state) { return free_state(instance, state); }

EXPORTED(Status, fmi2SerializedFMUstateSize)(Instance *instance, void *state, size_t *size)
{
    (void)instance, (void)state;
    *size = sizeof(Memory);
    return OK;
}

EXPORTED(Status, fmi2SerializeFMUstate)(Instance *instance, void *state, char bytes[], size_t size)
{
    return write_state(instance, state, bytes, size);
}

EXPORTED(Status, fmi2DeSerializeFMUstate)(Instance *instance, const char bytes[], size_t size, void **state)
{
    return read_state(instance, bytes, size, state);
}

EXPORTED(Status, fmi2GetDirectionalDerivative)(Instance *instance, const Reference unknowns[], size_t unknown_count,
                                               const Reference knowns[], size_t known_count, const double seed[],
                                               double sensitivity[])
{
    (void)unknowns, (void)unknown_count, (void)knowns, (void)known_count, (void)seed, (void)sensitivity;
    return unsupported(instance, "fmi2GetDirectionalDerivative");
}

EXPORTED(Status, fmi2SetRealInputDerivatives)(Instance *instance, const Reference references[], size_t count,
                                              const int orders[], const double values[])
{
    (void)references, (void)orders, (void)values;
    return count == 0 ? OK : unsupported(instance, "fmi2SetRealInputDerivatives");
}

EXPORTED(Status, fmi2GetRealOutputDerivatives)(Instance *instance, const Reference references[], size_t count,
                                               const int orders[], double values[])
{
    (void)references, (void)orders, (void)values;
    return count == 0 ? OK : unsupported(instance, "fmi2GetRealOutputDerivatives");
}

EXPORTED(Status, fmi2DoStep)(Instance *instance, double point, double length, int no_return)
{
    (void)no_return;
    Status status = step(instance, point, length);
    return status == OK && MODEL_ENDED(&instance->memory) ? DISCARD : status; /* so FMI 2.0 says "it has ended" */
}

EXPORTED(Status, fmi2CancelStep)(Instance *instance) { return unsupported(instance, "fmi2CancelStep"); }

EXPORTED(Status, fmi2GetStatus)(Instance *instance, int kind, Status *value)
{
    (void)instance, (void)kind, (void)value;
    return DISCARD; /* only of steps that go on after fmi2DoStep */
}

EXPORTED(Status, fmi2GetRealStatus)(Instance *instance, int kind, double *value)
{
    if (kind != LAST_SUCCESSFUL_TIME) {
        return DISCARD;
    }
    *value = instance->memory.time;
    return OK;
}

EXPORTED(Status, fmi2GetIntegerStatus)(Instance *instance, int kind, int *value)
{
    (void)instance, (void)kind, (void)value;
    return DISCARD;
}

EXPORTED(Status, fmi2GetBooleanStatus)(Instance *instance, int kind, int *value)
{
    if (kind != TERMINATED_STATUS) {
        return DISCARD;
    }
    *value = MODEL_ENDED(&instance->memory) ? 1 : 0;
    return OK;
}

EXPORTED(Status, fmi2GetStringStatus)(Instance *instance, int kind, const char **value)
{
    (void)instance, (void)kind, (void)value;
    return DISCARD;
}

/* Model exchange */

EXPORTED(Status, fmi2EnterEventMode)(Instance *instance) { return unsupported(instance, "fmi2EnterEventMode"); }

EXPORTED(Status, fmi2NewDiscreteStates)(Instance *instance, EventInfo *information)
{
    (void)information;
    return unsupported(instance, "fmi2NewDiscreteStates");
}

EXPORTED(Status, fmi2EnterContinuousTimeMode)(Instance *instance)
{
    return unsupported(instance, "fmi2EnterContinuousTimeMode");
}

EXPORTED(Status, fmi2CompletedIntegratorStep)(Instance *instance, int no_return, int *enter_event_mode,
                                              int *terminate_simulation)
{
    (void)no_return, (void)enter_event_mode, (void)terminate_simulation;
    return unsupported(instance, "fmi2CompletedIntegratorStep");
}

EXPORTED(Status, fmi2SetTime)(Instance *instance, double time)
{
    (void)time;
    return unsupported(instance, "fmi2SetTime");
}

EXPORTED(Status, fmi2SetContinuousStates)(Instance *instance, const double states[], size_t count)
{
    (void)states, (void)count;
    return unsupported(instance, "fmi2SetContinuousStates");
}

#define REFUSED_VECTOR(name)                                                        \
    EXPORTED(Status, name)(Instance *instance, double values[], size_t count)       \
    {                                                                               \
        (void)values, (void)count;                                                  \
        return unsupported(instance, #name);                                        \
    }

REFUSED_VECTOR(fmi2GetDerivatives)
REFUSED_VECTOR(fmi2GetEventIndicators)
REFUSED_VECTOR(fmi2GetContinuousStates)
REFUSED_VECTOR(fmi2GetNominalsOfContinuousStates)
