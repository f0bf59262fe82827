/* What FMI 2.0 and FMI 3.0 have in common: the memory of an instance, its variables, a step.

   Included by softstart_fmi2.c and softstart_fmi3.c. An FMU consists of one of these and softstart_model.c.
   softstart_model.h is generated; it tells the names, the variables and how the C code is called. */

#include <math.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef enum { KIND_FLOAT, KIND_DOUBLE, KIND_WHOLE, KIND_TRUTH } Kind;
typedef enum { SIDE_INPUT, SIDE_OUTPUT } Side;

/* A variable: its value reference is its place in the table; number 0 is the time. */
typedef struct {
    Kind kind;
    Side side;
    size_t offset; /* in the structure of its side */
    double start;
} Variable;

/* A real number is of single or double precision, as the C code has it. */
#define KIND_OF(structure, member) \
    (sizeof(((structure *)0)->member) == sizeof(float) ? KIND_FLOAT : KIND_DOUBLE)

#if defined(__GNUC__)
#pragma GCC visibility push(hidden)
#endif
#include "softstart_model.h"
#if defined(__GNUC__)
#pragma GCC visibility pop
#endif

static const Variable variables[] = { MODEL_VARIABLES };

#define VARIABLES (sizeof variables / sizeof variables[0])
#define SAME 1e-3 /* of a step: rounding of communication points that are sums or products of steps */

#if defined(_WIN32)
#define VISIBLE __declspec(dllexport)
#elif defined(__GNUC__)
#define VISIBLE __attribute__((visibility("default")))
#else
#define VISIBLE
#endif
#define PASTED(left, right) left##right
#define JOINED(left, right) PASTED(left, right)

/* Values of the status are those of FMI 2.0 and FMI 3.0. */
typedef enum { OK, WARNING, DISCARD, ERROR, FATAL, PENDING } Status;
typedef enum { INSTANTIATED, INITIALIZATION, STEPPING, TERMINATED } Mode;

/* All that changes; plain memory, so that a copy is the state of an FMU. */
typedef struct {
    MODEL_STATE state;
    MODEL_INPUT input;
    MODEL_OUTPUT output;
    double time;    /* s, next communication point */
    int64_t cycles; /* periods from the last step to the next one */
    Mode mode;
} Memory;

typedef struct Instance Instance;

struct Instance {
    Memory memory;
    bool logging;
    const char *name;
    void *environment;
    void (*log)(const Instance *instance, Status status, const char *message);
    void *callback;                        /* of the importer, called by `log` */
    void *(*allocate)(size_t count, size_t size);
    void (*release)(void *memory);
};

/* The status, with a sentence for the log of the importer. */
static Status report(const Instance *instance, Status status, const char *form, ...)
{
    if (instance->logging && instance->log != NULL) {
        char message[256];
        va_list arguments;
        va_start(arguments, form);
        vsnprintf(message, sizeof message, form, arguments);
        va_end(arguments);
        instance->log(instance, status, message);
    }
    return status;
}

static Status unsupported(const Instance *instance, const char *function)
{
    return report(instance, ERROR, "%s: not supported by this FMU.", function);
}

static void *place(Memory *memory, const Variable *variable)
{
    char *base = variable->side == SIDE_INPUT ? (char *)&memory->input : (char *)&memory->output;
    return base + variable->offset;
}

static void write_number(Memory *memory, const Variable *variable, double value)
{
    void *at = place(memory, variable);
    switch (variable->kind) {
    case KIND_FLOAT: *(float *)at = (float)value; break;
    case KIND_DOUBLE: *(double *)at = value; break;
    case KIND_WHOLE: *(int64_t *)at = (int64_t)value; break;
    case KIND_TRUTH: *(int *)at = value != 0.0; break;
    }
}

static double read_number(Memory *memory, const Variable *variable)
{
    const void *at = place(memory, variable);
    switch (variable->kind) {
    case KIND_FLOAT: return *(const float *)at;
    case KIND_DOUBLE: return *(const double *)at;
    case KIND_WHOLE: return (double)*(const int64_t *)at;
    case KIND_TRUTH: break;
    }
    return *(const int *)at != 0;
}

static bool real_kind(Kind kind)
{
    return kind == KIND_FLOAT || kind == KIND_DOUBLE;
}

/* The variable of a value reference if it has the kind (KIND_DOUBLE: either precision), else NULL. */
static const Variable *variable_of(const Instance *instance, uint32_t reference, Kind kind)
{
    const Variable *variable = reference >= 1 && reference <= VARIABLES ? &variables[reference - 1] : NULL;
    if (variable != NULL && (variable->kind == kind || (kind == KIND_DOUBLE && real_kind(variable->kind)))) {
        return variable;
    }
    report(instance, ERROR, "value reference %lu: no variable of this type.", (unsigned long)reference);
    return NULL;
}

static Status get_number(Instance *instance, uint32_t reference, Kind kind, double *value)
{
    if (reference == 0 && kind == KIND_DOUBLE) {
        *value = instance->memory.time;
        return OK;
    }
    const Variable *variable = variable_of(instance, reference, kind);
    if (variable == NULL) {
        return ERROR;
    }
    *value = read_number(&instance->memory, variable);
    return OK;
}

/* Whether this variable can be set now. */
static Status settable(const Instance *instance, uint32_t reference, Kind kind)
{
    const Variable *variable = variable_of(instance, reference, kind);
    if (variable == NULL) {
        return ERROR;
    }
    if (variable->side != SIDE_INPUT) {
        return report(instance, ERROR, "value reference %lu: not an input.", (unsigned long)reference);
    }
    if (instance->memory.mode == TERMINATED) {
        return report(instance, ERROR, "an input is set after the end of the simulation.");
    }
    return OK;
}

static void set_number(Instance *instance, uint32_t reference, double value)
{
    write_number(&instance->memory, &variables[reference - 1], value);
}

/* All is as it was after the instance was made. */
static void begin(Instance *instance)
{
    Memory *memory = &instance->memory;
    memset(memory, 0, sizeof *memory);
    MODEL_INIT(&memory->state);
    for (size_t i = 0; i < VARIABLES; i++) {
        if (variables[i].side == SIDE_INPUT) {
            write_number(memory, &variables[i], variables[i].start);
        }
    }
    memory->cycles = 1;
    MODEL_FIRST(memory);
}

static Status enter_initialization(Instance *instance)
{
    if (instance->memory.mode != INSTANTIATED) {
        return report(instance, ERROR, "the initialization begins twice.");
    }
    instance->memory.mode = INITIALIZATION;
    return OK;
}

static Status exit_initialization(Instance *instance)
{
    if (instance->memory.mode != INITIALIZATION) {
        return report(instance, ERROR, "the initialization ends without having begun.");
    }
    instance->memory.mode = STEPPING;
    return OK;
}

static Status terminate(Instance *instance)
{
    if (instance->memory.mode != STEPPING) {
        return report(instance, ERROR, "the simulation ends without having begun.");
    }
    instance->memory.mode = TERMINATED;
    return OK;
}

/* One communication step from `point` on, with the inputs as they are; a step that is refused changes nothing. */
static Status step(Instance *instance, double point, double length)
{
    Memory *memory = &instance->memory;
    if (memory->mode != STEPPING) {
        return report(instance, ERROR, "a step before the end of the initialization or after the last one.");
    }
    if (!(length > 0.0) || !(length < INFINITY)) {
        return report(instance, DISCARD, "step of %g s: not a time above 0.", length);
    }
    int64_t cycles = 1;
    if (MODEL_PERIOD > 0.0) {
        double whole = floor(length / MODEL_PERIOD + 0.5);
        if (!(whole >= 1.0 && whole < 1e15) || fabs(length / MODEL_PERIOD - whole) > SAME) {
            return report(instance, DISCARD, "step of %.9g s: not a whole multiple of the period, %.9g s.", length,
                          MODEL_PERIOD);
        }
        cycles = (int64_t)whole;
    }
    if (!(fabs(point - memory->time) <= SAME * length)) {
        return report(instance, ERROR, "step from %.9g s: the last one ended at %.9g s.", point, memory->time);
    }
    MODEL_STEP(memory, length);
    memory->cycles = cycles;
    memory->time = point + length;
    return OK;
}

/* Copies of the memory: a state of the FMU. */

static Status copy_state(Instance *instance, void **state)
{
    if (*state == NULL) {
        *state = instance->allocate(1, sizeof(Memory));
    }
    if (*state == NULL) {
        return report(instance, ERROR, "not enough memory for a state.");
    }
    memcpy(*state, &instance->memory, sizeof(Memory));
    return OK;
}

static Status restore_state(Instance *instance, const void *state)
{
    if (state == NULL) {
        return report(instance, ERROR, "no state to restore.");
    }
    memcpy(&instance->memory, state, sizeof(Memory));
    return OK;
}

static Status free_state(Instance *instance, void **state)
{
    if (state != NULL && *state != NULL) {
        instance->release(*state);
        *state = NULL;
    }
    return OK;
}

static Status write_state(const Instance *instance, const void *state, void *bytes, size_t size)
{
    if (state == NULL || size < sizeof(Memory)) {
        return report(instance, ERROR, "a state has %lu bytes.", (unsigned long)sizeof(Memory));
    }
    memcpy(bytes, state, sizeof(Memory));
    return OK;
}

static Status read_state(Instance *instance, const void *bytes, size_t size, void **state)
{
    if (size != sizeof(Memory)) {
        return report(instance, ERROR, "a state has %lu bytes, not %lu.", (unsigned long)sizeof(Memory),
                      (unsigned long)size);
    }
    if (*state == NULL) {
        *state = instance->allocate(1, sizeof(Memory));
    }
    if (*state == NULL) {
        return report(instance, ERROR, "not enough memory for a state.");
    }
    memcpy(*state, bytes, sizeof(Memory));
    return OK;
}

/* A new instance for this token and name, NULL if it is refused. */
static Instance *create(const Instance *draft, const char *token, const char *name)
{
    if (token == NULL || strcmp(token, MODEL_TOKEN) != 0) {
        report(draft, ERROR, "the token is not that of this FMU.");
        return NULL;
    }
    size_t size = strlen(name == NULL ? "" : name) + 1;
    Instance *instance = draft->allocate(1, sizeof *instance);
    char *copy = instance == NULL ? NULL : draft->allocate(size, 1);
    if (copy == NULL) {
        if (instance != NULL) {
            draft->release(instance);
        }
        report(draft, ERROR, "not enough memory for an instance.");
        return NULL;
    }
    memcpy(copy, name == NULL ? "" : name, size);
    *instance = *draft;
    instance->name = copy;
    begin(instance);
    return instance;
}

static void destroy(Instance *instance)
{
    if (instance != NULL) {
        void (*release)(void *) = instance->release;
        release((void *)(uintptr_t)instance->name);
        release(instance);
    }
}
