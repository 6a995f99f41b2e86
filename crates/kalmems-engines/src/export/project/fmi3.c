/*
 * @about@: a unit of FMI 3.0 for co-simulation.
 *
 * A step of the communication is one sample: its inputs and measurements are those at the beginning of the step, and the estimate that the outputs have
 * after it is of that time as well. Between two samples an input is a straight line.
 */
#include "fmi3Functions.h"
#include "@name@.h"

#include <stdlib.h>
#include <string.h>

#define INPUTS @inputs@
#define STATES @states@
/* The references of the variables: time, inputs, states, their variances, and the status of each measurement. */
#define FIRST_INPUT 1U
#define FIRST_STATE (FIRST_INPUT + INPUTS)
#define FIRST_VARIANCE (FIRST_STATE + STATES)
#define FIRST_STATUS (FIRST_VARIANCE + STATES)
#define TOKEN "@token@"
#define INTERVAL_S @interval@

typedef struct {
    @name@_t filter;
    float before[INPUTS];
    float now[INPUTS];
    double time_s;
    int has_begun;
    fmi3InstanceEnvironment environment;
    fmi3LogMessageCallback log;
} unit_t;

static fmi3Status refused(const unit_t *unit, const char *why)
{
    if (unit != NULL && unit->log != NULL) {
        unit->log(unit->environment, fmi3Error, "error", why);
    }
    return fmi3Error;
}

static void begin(unit_t *unit)
{
    unsigned k;
    @name@_start(&unit->filter);
    for (k = 0U; k < INPUTS; k++) {
        unit->before[k] = unit->now[k] = 0.0F;
    }
    unit->time_s = 0.0;
    unit->has_begun = 0;
}

const char *fmi3GetVersion(void) { return fmi3Version; }

fmi3Status fmi3SetDebugLogging(fmi3Instance instance, fmi3Boolean on, size_t count, const fmi3String categories[])
{
    (void)instance, (void)on, (void)count, (void)categories;
    return fmi3OK;
}

fmi3Instance fmi3InstantiateCoSimulation(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logs,
                                         fmi3Boolean events, fmi3Boolean early, const fmi3ValueReference required[], size_t count,
                                         fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3IntermediateUpdateCallback update)
{
    unit_t *unit;
    (void)name, (void)resources, (void)visible, (void)logs, (void)early, (void)required, (void)count, (void)update;
    if (token == NULL || strcmp(token, TOKEN) != 0 || events) {
        return NULL;
    }
    unit = calloc(1U, sizeof *unit);
    if (unit != NULL) {
        unit->environment = environment;
        unit->log = log;
        begin(unit);
    }
    return unit;
}

fmi3Instance fmi3InstantiateModelExchange(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logs,
                                          fmi3InstanceEnvironment environment, fmi3LogMessageCallback log)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logs, (void)environment, (void)log;
    return NULL;
}

fmi3Instance fmi3InstantiateScheduledExecution(fmi3String name, fmi3String token, fmi3String resources, fmi3Boolean visible, fmi3Boolean logs,
                                               fmi3InstanceEnvironment environment, fmi3LogMessageCallback log, fmi3ClockUpdateCallback clock,
                                               fmi3LockPreemptionCallback lock, fmi3UnlockPreemptionCallback unlock)
{
    (void)name, (void)token, (void)resources, (void)visible, (void)logs, (void)environment, (void)log, (void)clock, (void)lock, (void)unlock;
    return NULL;
}

void fmi3FreeInstance(fmi3Instance instance) { free(instance); }

fmi3Status fmi3EnterInitializationMode(fmi3Instance instance, fmi3Boolean has_tolerance, fmi3Float64 tolerance, fmi3Float64 start_s,
                                       fmi3Boolean has_stop, fmi3Float64 stop_s)
{
    (void)has_tolerance, (void)tolerance, (void)has_stop, (void)stop_s;
    ((unit_t *)instance)->time_s = start_s;
    return fmi3OK;
}

fmi3Status fmi3ExitInitializationMode(fmi3Instance instance) { return instance != NULL ? fmi3OK : fmi3Error; }
fmi3Status fmi3Terminate(fmi3Instance instance) { return instance != NULL ? fmi3OK : fmi3Error; }

fmi3Status fmi3Reset(fmi3Instance instance)
{
    begin(instance);
    return fmi3OK;
}

fmi3Status fmi3GetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t count, fmi3Float64 values[], size_t given)
{
    const unit_t *const unit = instance;
    size_t k;
    if (count != given) {
        return refused(unit, "each reference has one value");
    }
    for (k = 0U; k < count; k++) {
        const fmi3ValueReference at = references[k];
        if (at == 0U) {
            values[k] = unit->time_s;
        } else if (at < FIRST_STATE) {
            values[k] = (double)unit->now[at - FIRST_INPUT];
        } else if (at < FIRST_VARIANCE) {
            values[k] = (double)@name@_value(&unit->filter, at - FIRST_STATE);@variances@
        } else {
            return refused(unit, "there is no number of this reference");
        }
    }
    return fmi3OK;
}

fmi3Status fmi3SetFloat64(fmi3Instance instance, const fmi3ValueReference references[], size_t count, const fmi3Float64 values[], size_t given)
{
    unit_t *const unit = instance;
    size_t k;
    if (count != given) {
        return refused(unit, "each reference has one value");
    }
    for (k = 0U; k < count; k++) {
        if (references[k] < FIRST_INPUT || references[k] >= FIRST_STATE) {
            return refused(unit, "there is no input of this reference");
        }
        unit->now[references[k] - FIRST_INPUT] = (float)values[k];
    }
    return fmi3OK;
}

fmi3Status fmi3GetInt32(fmi3Instance instance, const fmi3ValueReference references[], size_t count, fmi3Int32 values[], size_t given)
{
    const unit_t *const unit = instance;
    size_t k;
    if (count != given) {
        return refused(unit, "each reference has one value");
    }
    for (k = 0U; k < count; k++) {
        if (references[k] < FIRST_STATUS || references[k] - FIRST_STATUS >= @NAME@_MEASUREMENTS) {
            return refused(unit, "there is no status of this reference");
        }
        values[k] = (fmi3Int32)@name@_status(&unit->filter, references[k] - FIRST_STATUS);
    }
    return fmi3OK;
}

fmi3Status fmi3DoStep(fmi3Instance instance, fmi3Float64 at_s, fmi3Float64 step_s, fmi3Boolean keeps, fmi3Boolean *event, fmi3Boolean *ends,
                      fmi3Boolean *early, fmi3Float64 *last_s)
{
    unit_t *const unit = instance;
    const double apart = step_s / INTERVAL_S - 1.0;
    (void)keeps;
    if (!(apart < 1e-3 && apart > -1e-3)) {
        return refused(unit, "a step of the communication must be @interval@ s, the interval of the filter");
    }
    if (!unit->has_begun) {
        memcpy(unit->before, unit->now, sizeof unit->now);
        unit->has_begun = 1;
    }
    (void)@name@_step(&unit->filter@given@);
    memcpy(unit->before, unit->now, sizeof unit->now);
    unit->time_s = at_s + step_s;
    *event = *ends = *early = fmi3False;
    *last_s = unit->time_s;
    return fmi3OK;
}

fmi3Status fmi3GetFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    if (*state == NULL) {
        *state = malloc(sizeof(unit_t));
    }
    if (*state == NULL) {
        return refused(instance, "there is no memory");
    }
    memcpy(*state, instance, sizeof(unit_t));
    return fmi3OK;
}

fmi3Status fmi3SetFMUState(fmi3Instance instance, fmi3FMUState state)
{
    memcpy(instance, state, sizeof(unit_t));
    return fmi3OK;
}

fmi3Status fmi3FreeFMUState(fmi3Instance instance, fmi3FMUState *state)
{
    (void)instance;
    free(*state);
    *state = NULL;
    return fmi3OK;
}

/* What the unit does not have. */
#define ABSENT(name, arguments) \
    fmi3Status name arguments { return refused(instance, #name " is not supported"); }
#define REFERENCES fmi3Instance instance, const fmi3ValueReference references[], size_t count
#define ABSENT_NUMBER(type) \
    ABSENT(fmi3Get##type, (REFERENCES, fmi3##type values[], size_t given)) \
    ABSENT(fmi3Set##type, (REFERENCES, const fmi3##type values[], size_t given))
#if defined(__GNUC__)
#pragma GCC diagnostic ignored "-Wunused-parameter"
#endif
ABSENT_NUMBER(Float32)
ABSENT_NUMBER(Int8)
ABSENT_NUMBER(UInt8)
ABSENT_NUMBER(Int16)
ABSENT_NUMBER(UInt16)
ABSENT_NUMBER(UInt32)
ABSENT_NUMBER(Int64)
ABSENT_NUMBER(UInt64)
ABSENT_NUMBER(Boolean)
ABSENT_NUMBER(String)
ABSENT(fmi3SetInt32, (REFERENCES, const fmi3Int32 values[], size_t given))
ABSENT(fmi3GetBinary, (REFERENCES, size_t sizes[], fmi3Binary values[], size_t given))
ABSENT(fmi3SetBinary, (REFERENCES, const size_t sizes[], const fmi3Binary values[], size_t given))
ABSENT(fmi3GetClock, (REFERENCES, fmi3Clock values[]))
ABSENT(fmi3SetClock, (REFERENCES, const fmi3Clock values[]))
ABSENT(fmi3EnterEventMode, (fmi3Instance instance))
ABSENT(fmi3EnterStepMode, (fmi3Instance instance))
ABSENT(fmi3EnterConfigurationMode, (fmi3Instance instance))
ABSENT(fmi3ExitConfigurationMode, (fmi3Instance instance))
ABSENT(fmi3GetNumberOfVariableDependencies, (fmi3Instance instance, fmi3ValueReference of, size_t *count))
ABSENT(fmi3GetVariableDependencies, (fmi3Instance instance, fmi3ValueReference of, size_t elements[], fmi3ValueReference independents[],
                                     size_t their_elements[], fmi3DependencyKind kinds[], size_t count))
ABSENT(fmi3SerializedFMUStateSize, (fmi3Instance instance, fmi3FMUState state, size_t *size))
ABSENT(fmi3SerializeFMUState, (fmi3Instance instance, fmi3FMUState state, fmi3Byte bytes[], size_t size))
ABSENT(fmi3DeserializeFMUState, (fmi3Instance instance, const fmi3Byte bytes[], size_t size, fmi3FMUState *state))
ABSENT(fmi3GetDirectionalDerivative, (fmi3Instance instance, const fmi3ValueReference unknowns[], size_t unknown, const fmi3ValueReference knowns[],
                                      size_t known, const fmi3Float64 seed[], size_t seeds, fmi3Float64 sensitivity[], size_t count))
ABSENT(fmi3GetAdjointDerivative, (fmi3Instance instance, const fmi3ValueReference unknowns[], size_t unknown, const fmi3ValueReference knowns[],
                                  size_t known, const fmi3Float64 seed[], size_t seeds, fmi3Float64 sensitivity[], size_t count))
ABSENT(fmi3GetIntervalDecimal, (REFERENCES, fmi3Float64 intervals[], fmi3IntervalQualifier qualifiers[]))
ABSENT(fmi3GetIntervalFraction, (REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[], fmi3IntervalQualifier qualifiers[]))
ABSENT(fmi3GetShiftDecimal, (REFERENCES, fmi3Float64 shifts[]))
ABSENT(fmi3GetShiftFraction, (REFERENCES, fmi3UInt64 counters[], fmi3UInt64 resolutions[]))
ABSENT(fmi3SetIntervalDecimal, (REFERENCES, const fmi3Float64 intervals[]))
ABSENT(fmi3SetIntervalFraction, (REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]))
ABSENT(fmi3SetShiftDecimal, (REFERENCES, const fmi3Float64 shifts[]))
ABSENT(fmi3SetShiftFraction, (REFERENCES, const fmi3UInt64 counters[], const fmi3UInt64 resolutions[]))
ABSENT(fmi3EvaluateDiscreteStates, (fmi3Instance instance))
ABSENT(fmi3UpdateDiscreteStates, (fmi3Instance instance, fmi3Boolean *again, fmi3Boolean *ends, fmi3Boolean *nominals, fmi3Boolean *values,
                                  fmi3Boolean *has_next, fmi3Float64 *next_s))
ABSENT(fmi3GetOutputDerivatives, (REFERENCES, const fmi3Int32 orders[], fmi3Float64 values[], size_t given))
ABSENT(fmi3ActivateModelPartition, (fmi3Instance instance, fmi3ValueReference clock, fmi3Float64 time_s))
ABSENT(fmi3EnterContinuousTimeMode, (fmi3Instance instance))
ABSENT(fmi3CompletedIntegratorStep, (fmi3Instance instance, fmi3Boolean keeps, fmi3Boolean *event, fmi3Boolean *ends))
ABSENT(fmi3SetTime, (fmi3Instance instance, fmi3Float64 time_s))
ABSENT(fmi3GetContinuousStates, (fmi3Instance instance, fmi3Float64 states[], size_t count))
ABSENT(fmi3SetContinuousStates, (fmi3Instance instance, const fmi3Float64 states[], size_t count))
ABSENT(fmi3GetContinuousStateDerivatives, (fmi3Instance instance, fmi3Float64 derivatives[], size_t count))
ABSENT(fmi3GetNominalsOfContinuousStates, (fmi3Instance instance, fmi3Float64 nominals[], size_t count))
ABSENT(fmi3GetEventIndicators, (fmi3Instance instance, fmi3Float64 indicators[], size_t count))
ABSENT(fmi3GetNumberOfEventIndicators, (fmi3Instance instance, size_t *count))
ABSENT(fmi3GetNumberOfContinuousStates, (fmi3Instance instance, size_t *count))
