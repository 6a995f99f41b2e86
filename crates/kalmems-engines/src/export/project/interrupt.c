/*
 * Samples that come in an interrupt, and the filter in the main loop: a ring of which the interrupt moves one end and the loop the other.
 *
 * The functions of the filter keep nothing outside of the structure that they are handed: several filters may be used in several threads, and one
 * filter in one thread at a time. The ring is for one processor core; between two cores its counts need the atomic types of C11.
 *
 * With FreeRTOS the loop is a task: compile with WITH_FREERTOS, and create a task of filter_task.
 */
#include "@name@.h"

#include <stdint.h>
#ifdef WITH_FREERTOS
#include "FreeRTOS.h"
#include "task.h"
#endif

/* The numbers of a sample: @columns@. */
#define NUMBERS @count@U
/* How many samples wait at most: a power of two, so that their counts may overflow. */
#define WAITING 64U

static volatile float ring[WAITING][NUMBERS];
/* How many samples were lost before each because the ring was full. */
static volatile uint32_t lost[WAITING];
/* How many samples were written and read: each count is written in one place. */
static volatile uint32_t written, taken;

#ifdef WITH_FREERTOS
static TaskHandle_t waiting_task;
#endif

/* Called by the interrupt of a converter with the numbers of a sample in SI. */
void sample_arrives(const float numbers[NUMBERS]);
/* The samples that wait, into the filter; how many there were, with the lost ones. */
uint32_t filter_samples(@name@_t *filter);

void sample_arrives(const float numbers[NUMBERS])
{
    static uint32_t missed;
    unsigned k;
#ifdef WITH_FREERTOS
    BaseType_t switches = pdFALSE;
#endif
    if (written - taken < WAITING) {
        for (k = 0U; k < NUMBERS; k++) {
            ring[written % WAITING][k] = numbers[k];
        }
        lost[written % WAITING] = missed;
        missed = 0U;
        written = written + 1U;
    } else {
        missed++;
    }
#ifdef WITH_FREERTOS
    vTaskNotifyGiveFromISR(waiting_task, &switches);
    portYIELD_FROM_ISR(switches);
#endif
}

uint32_t filter_samples(@name@_t *filter)
{
    uint32_t count = 0U, missed;
    unsigned k;
    while (taken != written) {
        float numbers[NUMBERS];
        for (k = 0U; k < NUMBERS; k++) {
            numbers[k] = ring[taken % WAITING][k];
        }
        missed = lost[taken % WAITING];
        taken = taken + 1U;
        for (; missed > 0U; missed--) {
            /* A lost sample is a gap, for which time goes on: there is no state of this place, and its value is not a number. */
            const float gap = @name@_value(filter, @NAME@_STATES);
            (void)@name@_step(filter@gaps@);
            count++;
        }
        (void)@name@_step(filter@numbers@);
        count++;
    }
    return count;
}

#ifdef WITH_FREERTOS
void filter_task(void *unused);
void filter_task(void *unused)
{
    static @name@_t filter;
    (void)unused;
    @name@_start(&filter);
    waiting_task = xTaskGetCurrentTaskHandle();
    /* Begin the converter here. */
    for (;;) {
        (void)ulTaskNotifyTake(pdTRUE, portMAX_DELAY);
        (void)filter_samples(&filter);
        /* Use @name@_value and @name@_status here. */
    }
}
#elif !defined(WITHOUT_MAIN)
int main(void)
{
    static @name@_t filter;
    @name@_start(&filter);
    /* Begin the converter here. */
    for (;;) {
        (void)filter_samples(&filter);
        /* Use @name@_value and @name@_status here. */
#if defined(__ARM_ARCH_PROFILE) && __ARM_ARCH_PROFILE == 'M'
        __asm volatile("wfi");
#endif
    }
}
#endif
