/* The filter's test of itself as a program: 0 where it passes. */
#include "@name@_self_test.h"
#include <stdio.h>

int main(void)
{
    float worst;
    const int passes = @name@_self_test(&worst);
    printf("%g of the largest value of a state\n", (double)worst);
    return passes ? 0 : 1;
}
