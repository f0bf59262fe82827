/* The functions of FMI 3.0 for co-simulation; those of model exchange, scheduled execution and clocks are refused. */

#include "softstart_fmu.c"

#if defined(FMI3_FUNCTION_PREFIX)
#define NAMED(name) JOINED(FMI3_FUNCTION_PREFIX, name)
#else
#define NAMED(name) name
#endif
#define EXPORTED(result, name) VISIBLE result NAMED(name)

typedef uint32_t Reference;
typedef void (*Logger)(void *environment, Status status, const char *category, const char *message);

static void log_message(const Instance *instance, Status status, const char *message)
{
    Logger logger;
    memcpy(&logger, &instance->callback, sizeof logger); /* the standard knows no conversion to a function */
    if (logger != NULL) {
        logger(instance->environment, status, status == DISCARD ? "logStatusDiscard" : "logStatusError", message);
    }
}

static Instance draft_of(const char *name, void *environment, Logger logger)
{
    Instance draft = {0};
    draft.logging = true; /* why an FMU cannot be instantiated is told in any case */
    draft.name = name == NULL ? "" : name;
    draft.environment = environment;
    draft.log = log_message;
    memcpy(&draft.callback, &logger, sizeof logger);
    draft.allocate = calloc;
    draft.release = free;
    return draft;
}

EXPORTED(const char *, fmi3GetVersion)(void) { return "3.0"; }

EXPORTED(Status, fmi3SetDebugLogging)(Instance *instance, bool on, size_t count, const char *const categories[])
{
    (void)count, (void)categories;
    instance->logging = on;
    return OK;
}

EXPORTED(Instance *, fmi3InstantiateCoSimulation)(
    const char *name, const char *token, const char *resources, bool visible, bool logging, bool event_mode,
    bool early_return, const Reference intermediate[], size_t intermediate_count, void *environment, Logger logger,
    void (*intermediate_update)(void *, double, bool, bool, bool, bool, bool *, double *))
{
    (void)resources, (void)visible, (void)early_return;
    (void)intermediate, (void)intermediate_count, (void)intermediate_update;
    Instance draft = draft_of(name, environment, logger);
    if (event_mode) {
        report(&draft, ERROR, "this FMU has no event mode.");
        return NULL;
    }
    Instance *instance = create(&draft, token, name);
    if (instance != NULL) {
        instance->logging = logging;
    }
    return instance;
}

EXPORTED(Instance *, fmi3InstantiateModelExchange)(const char *name, const char *token, const char *resources,
                                                   bool visible, bool logging, void *environment, Logger logger)
{
    (void)token, (void)resources, (void)visible, (void)logging;
    Instance draft = draft_of(name, environment, logger);
    unsupported(&draft, "fmi3InstantiateModelExchange");
    return NULL;
}

EXPORTED(Instance *, fmi3InstantiateScheduledExecution)(const char *name, const char *token, const char *resources,
                                                        bool visible, bool logging, void *environment, Logger logger,
                                                        void (*clock_update)(void *), void (*lock)(void),
                                                        void (*unlock)(void))
{
    (void)token, (void)resources, (void)visible, (void)logging, (void)clock_update, (void)lock, (void)unlock;
    Instance draft = draft_of(name, environment, logger);
    unsupported(&draft, "fmi3InstantiateScheduledExecution");
    return NULL;
}

EXPORTED(void, fmi3FreeInstance)(Instance *instance) { destroy(instance); }

EXPORTED(Status, fmi3EnterInitializationMode)(Instance *instance, bool tolerance_defined, double tolerance,
                                              double start, bool stop_defined, double stop)
{
    (void)tolerance_defined, (void)tolerance, (void)stop_defined, (void)stop;
    Status status = enter_initialization(instance);
    if (status == OK) {
        instance->memory.time = start;
    }
    return status;
}

EXPORTED(Status, fmi3ExitInitializationMode)(Instance *instance) { return exit_initialization(instance); }
EXPORTED(Status, fmi3Terminate)(Instance *instance) { return terminate(instance); }

EXPORTED(Status, fmi3Reset)(Instance *instance)
{
    begin(instance);
    return OK;
}

static Status counted(const Instance *instance, size_t references, size_t values)
{
    return references == values ? OK : report(instance, ERROR, "every variable of this FMU has one value.");
}

#define GET_FUNCTION(name, type, kind)                                                                           \
    EXPORTED(Status, name)(Instance *instance, const Reference references[], size_t count, type values[],        \
                           size_t value_count)                                                                   \
    {                                                                                                            \
        if (counted(instance, count, value_count) != OK) {                                                       \
            return ERROR;                                                                                        \
        }                                                                                                        \
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
    EXPORTED(Status, name)(Instance *instance, const Reference references[], size_t count, const type values[],  \
                           size_t value_count)                                                                   \
    {                                                                                                            \
        if (counted(instance, count, value_count) != OK) {                                                       \
            return ERROR;                                                                                        \
        }                                                                                                        \
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

GET_FUNCTION(fmi3GetFloat64, double, KIND_DOUBLE)
GET_FUNCTION(fmi3GetInt32, int32_t, KIND_WHOLE)
GET_FUNCTION(fmi3GetBoolean, bool, KIND_TRUTH)
SET_FUNCTION(fmi3SetFloat64, double, KIND_DOUBLE)
SET_FUNCTION(fmi3SetInt32, int32_t, KIND_WHOLE)
SET_FUNCTION(fmi3SetBoolean, bool, KIND_TRUTH)

/* Types that no variable of this FMU has */

#define REFUSED_TYPE(get_name, set_name, type)                                                                   \
    EXPORTED(Status, get_name)(Instance *instance, const Reference references[], size_t count, type values[],    \
                               size_t value_count)                                                               \
    {                                                                                                            \
        (void)references, (void)values, (void)value_count;                                                       \
        return count == 0 ? OK : unsupported(instance, #get_name);                                               \
    }                                                                                                            \
    EXPORTED(Status, set_name)(Instance *instance, const Reference references[], size_t count,                   \
                               type const values[], size_t value_count)                                          \
    {                                                                                                            \
        (void)references, (void)values, (void)value_count;                                                       \
        return count == 0 ? OK : unsupported(instance, #set_name);                                               \
    }

REFUSED_TYPE(fmi3GetFloat32, fmi3SetFloat32, float)
REFUSED_TYPE(fmi3GetInt8, fmi3SetInt8, int8_t)
REFUSED_TYPE(fmi3GetUInt8, fmi3SetUInt8, uint8_t)
REFUSED_TYPE(fmi3GetInt16, fmi3SetInt16, int16_t)
REFUSED_TYPE(fmi3GetUInt16, fmi3SetUInt16, uint16_t)
REFUSED_TYPE(fmi3GetUInt32, fmi3SetUInt32, uint32_t)
REFUSED_TYPE(fmi3GetInt64, fmi3SetInt64, int64_t)
REFUSED_TYPE(fmi3GetUInt64, fmi3SetUInt64, uint64_t)
REFUSED_TYPE(fmi3GetString, fmi3SetString, const char *)

EXPORTED(Status, fmi3GetBinary)(Instance *instance, const Reference references[], size_t count, size_t sizes[],
                                const uint8_t *values[], size_t value_count)
{
    (void)references, (void)sizes, (void)values, (void)value_count;
    return count == 0 ? OK : unsupported(instance, "fmi3GetBinary");
}

EXPORTED(Status, fmi3SetBinary)(Instance *instance, const Reference references[], size_t count, const size_t sizes[],
                                const uint8_t *const values[], size_t value_count)
{
    (void)references, (void)sizes, (void)values, (void)value_count;
    return count == 0 ? OK : unsupported(instance, "fmi3SetBinary");
}

EXPORTED(Status, fmi3GetClock)(Instance *instance, const Reference references[], size_t count, bool values[])
{
    (void)references, (void)values;
    return count == 0 ? OK : unsupported(instance, "fmi3GetClock");
}

EXPORTED(Status, fmi3SetClock)(Instance *instance, const Reference references[], size_t count, const bool values[])
{
    (void)references, (void)values;
    return count == 0 ? OK : unsupported(instance, "fmi3SetClock");
}

/* State */

EXPORTED(Status, fmi3GetFMUState)(Instance *instance, void **state) { return copy_state(instance, state); }
EXPORTED(Status, fmi3SetFMUState)(Instance *instance, void *state) { return restore_state(instance, state); }
EXPORTED(Status, fmi3FreeFMUState)(Instance *instance, void **state) { return free_state(instance, state); }

EXPORTED(Status, fmi3SerializedFMUStateSize)(Instance *instance, void *state, size_t *size)
{
    (void)instance, (void)state;
    *size = sizeof(Memory);
    return OK;
}

EXPORTED(Status, fmi3SerializeFMUState)(Instance *instance, void *state, uint8_t bytes[], size_t size)
{
    return write_state(instance, state, bytes, size);
}

EXPORTED(Status, fmi3DeserializeFMUState)(Instance *instance, const uint8_t bytes[], size_t size, void **state)
{
    return read_state(instance, bytes, size, state);
}

/* Co-simulation */

EXPORTED(Status, fmi3EnterStepMode)(Instance *instance) { return unsupported(instance, "fmi3EnterStepMode"); }

EXPORTED(Status, fmi3GetOutputDerivatives)(Instance *instance, const Reference references[], size_t count,
                                           const int32_t orders[], double values[], size_t value_count)
{
    (void)references, (void)orders, (void)values, (void)value_count;
    return count == 0 ? OK : unsupported(instance, "fmi3GetOutputDerivatives");
}

EXPORTED(Status, fmi3DoStep)(Instance *instance, double point, double length, bool no_return, bool *event_needed,
                             bool *terminate_simulation, bool *early_return, double *last_time)
{
    (void)no_return;
    Status status = step(instance, point, length);
    *event_needed = false;
    *early_return = false;
    *terminate_simulation = MODEL_ENDED(&instance->memory);
    *last_time = instance->memory.time;
    return status;
}

/* Dependencies and derivatives */

EXPORTED(Status, fmi3GetNumberOfVariableDependencies)(Instance *instance, Reference reference, size_t *count)
{
    (void)reference, (void)count;
    return unsupported(instance, "fmi3GetNumberOfVariableDependencies");
}

EXPORTED(Status, fmi3GetVariableDependencies)(Instance *instance, Reference dependent, size_t dependent_elements[],
                                              Reference independents[], size_t independent_elements[], int kinds[],
                                              size_t count)
{
    (void)dependent, (void)dependent_elements, (void)independents, (void)independent_elements, (void)kinds, (void)count;
    return unsupported(instance, "fmi3GetVariableDependencies");
}

#define REFUSED_DERIVATIVE(name)                                                                                 \
    EXPORTED(Status, name)(Instance *instance, const Reference unknowns[], size_t unknown_count,                 \
                           const Reference knowns[], size_t known_count, const double seed[], size_t seed_count, \
                           double sensitivity[], size_t sensitivity_count)                                       \
    {                                                                                                            \
        (void)unknowns, (void)unknown_count, (void)knowns, (void)known_count;                                    \
        (void)seed, (void)seed_count, (void)sensitivity, (void)sensitivity_count;                                \
        return unsupported(instance, #name);                                                                     \
    }

REFUSED_DERIVATIVE(fmi3GetDirectionalDerivative)
REFUSED_DERIVATIVE(fmi3GetAdjointDerivative)

/* Modes that this FMU does not have */

#define REFUSED_MODE(name) \
    EXPORTED(Status, name)(Instance *instance) { return unsupported(instance, #name); }

REFUSED_MODE(fmi3EnterEventMode)
REFUSED_MODE(fmi3EnterConfigurationMode)
REFUSED_MODE(fmi3ExitConfigurationMode)
REFUSED_MODE(fmi3EvaluateDiscreteStates)
REFUSED_MODE(fmi3EnterContinuousTimeMode)

EXPORTED(Status, fmi3UpdateDiscreteStates)(Instance *instance, bool *need_update, bool *terminate_simulation,
                                           bool *nominals_changed, bool *values_changed, bool *next_event_defined,
                                           double *next_event_time)
{
    (void)need_update, (void)terminate_simulation, (void)nominals_changed, (void)values_changed;
    (void)next_event_defined, (void)next_event_time;
    return unsupported(instance, "fmi3UpdateDiscreteStates");
}

/* Clocks and scheduled execution */

EXPORTED(Status, fmi3GetIntervalDecimal)(Instance *instance, const Reference references[], size_t count,
                                         double intervals[], int qualifiers[])
{
    (void)references, (void)count, (void)intervals, (void)qualifiers;
    return unsupported(instance, "fmi3GetIntervalDecimal");
}

EXPORTED(Status, fmi3GetIntervalFraction)(Instance *instance, const Reference references[], size_t count,
                                          uint64_t counters[], uint64_t resolutions[], int qualifiers[])
{
    (void)references, (void)count, (void)counters, (void)resolutions, (void)qualifiers;
    return unsupported(instance, "fmi3GetIntervalFraction");
}

#define REFUSED_DECIMAL(name, type)                                                                              \
    EXPORTED(Status, name)(Instance *instance, const Reference references[], size_t count, type values[])        \
    {                                                                                                            \
        (void)references, (void)count, (void)values;                                                             \
        return unsupported(instance, #name);                                                                     \
    }
#define REFUSED_FRACTION(name, type)                                                                             \
    EXPORTED(Status, name)(Instance *instance, const Reference references[], size_t count, type counters[],      \
                           type resolutions[])                                                                   \
    {                                                                                                            \
        (void)references, (void)count, (void)counters, (void)resolutions;                                        \
        return unsupported(instance, #name);                                                                     \
    }

REFUSED_DECIMAL(fmi3GetShiftDecimal, double)
REFUSED_DECIMAL(fmi3SetIntervalDecimal, const double)
REFUSED_DECIMAL(fmi3SetShiftDecimal, const double)
REFUSED_FRACTION(fmi3GetShiftFraction, uint64_t)
REFUSED_FRACTION(fmi3SetIntervalFraction, const uint64_t)
REFUSED_FRACTION(fmi3SetShiftFraction, const uint64_t)

EXPORTED(Status, fmi3ActivateModelPartition)(Instance *instance, Reference clock, double time)
{
    (void)clock, (void)time;
    return unsupported(instance, "fmi3ActivateModelPartition");
}

/* Model exchange */

EXPORTED(Status, fmi3CompletedIntegratorStep)(Instance *instance, bool no_return, bool *enter_event_mode,
                                              bool *terminate_simulation)
{
    (void)no_return, (void)enter_event_mode, (void)terminate_simulation;
    return unsupported(instance, "fmi3CompletedIntegratorStep");
}

EXPORTED(Status, fmi3SetTime)(Instance *instance, double time)
{
    (void)time;
    return unsupported(instance, "fmi3SetTime");
}

#define REFUSED_VECTOR(name, type)                                                  \
    EXPORTED(Status, name)(Instance *instance, type values[], size_t count)         \
    {                                                                               \
        (void)values, (void)count;                                                  \
        return unsupported(instance, #name);                                        \
    }
#define REFUSED_COUNT(name)                                                         \
    EXPORTED(Status, name)(Instance *instance, size_t *count)                       \
    {                                                                               \
        (void)count;                                                                \
        return unsupported(instance, #name);                                        \
    }

REFUSED_VECTOR(fmi3SetContinuousStates, const double)
REFUSED_VECTOR(fmi3GetContinuousStateDerivatives, double)
REFUSED_VECTOR(fmi3GetEventIndicators, double)
REFUSED_VECTOR(fmi3GetContinuousStates, double)
REFUSED_VECTOR(fmi3GetNominalsOfContinuousStates, double)
REFUSED_COUNT(fmi3GetNumberOfEventIndicators)
REFUSED_COUNT(fmi3GetNumberOfContinuousStates)
