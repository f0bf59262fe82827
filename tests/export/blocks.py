"""C code with the interface of exported controllers and machines, so small that its answers are known."""

from __future__ import annotations

from softstart.export.fmu import Model, Signal

CONTROLLER = {
    "count.h": """#ifndef COUNT_H
#define COUNT_H
#include <stdint.h>
typedef double count_real;
typedef struct { int64_t sample; double sum; } count_State;
typedef struct { int run; count_real speed; double angle; int64_t cycles; } count_Input;
typedef struct { count_real torque; int64_t fault; } count_Output;
void count_init(count_State *state);
void count_step(count_State *state, const count_Input *input, count_Output *output);
#endif
""",
    "count.c": """#include <math.h>
#include "count.h"
static double step(double x) { return sqrt(x); } /* a name of the functions of FMI, too */
void count_init(count_State *state)
{
    state->sample = 0;
    state->sum = 0.0;
}
void count_step(count_State *state, const count_Input *input, count_Output *output)
{
    state->sample += input->cycles;
    state->sum += input->run ? input->angle : 0.0;
    output->torque = (count_real)(state->sum + step((double)state->sample) * input->speed);
    output->fault = input->cycles == 1 ? 0 : 2;
}
""",
}
MACHINE = {
    "turn.h": """#ifndef TURN_H
#define TURN_H
typedef struct { double angle, speed, time; } turn_State;
typedef struct { double torque; } turn_Input;
typedef struct { double motor_angle, motor_speed; int ended; } turn_Output;
void turn_init(turn_State *state);
void turn_step(turn_State *state, const turn_Input *input, turn_Output *output, double h);
#endif
""",
    "turn.c": """#include "turn.h"
void turn_init(turn_State *state)
{
    state->angle = 0.25;
    state->speed = state->time = 0.0;
}
void turn_step(turn_State *state, const turn_Input *input, turn_Output *output, double h)
{
    state->angle += state->speed * h + 0.5 * input->torque * h * h;
    state->speed += input->torque * h;
    state->time += h;
    output->motor_angle = state->angle;
    output->motor_speed = state->speed;
    output->ended = state->time > 0.9;
}
""",
}
COUNT = Model(
    "counts & adds",
    "count",
    (
        Signal("run", "truth", description="1 to run", start=1.0),
        Signal("speed", "real", "rad/s", "of the <motor>", 2.0),
        Signal("angle", "double", "rad", "of the motor"),
    ),
    (Signal("torque", "real", "N m", "demand"), Signal("fault", "whole", description="0 for none")),
    CONTROLLER,
    "# Counts & adds\n",
    period=0.002,
)
TURN = Model(
    "turns",
    "turn",
    (Signal("torque", "real", "N m", "demand"),),
    (
        Signal("motor_angle", "double", "rad"),
        Signal("motor_speed", "real", "rad/s"),
        Signal("ended", "truth"),
    ),
    MACHINE,
    "# Turns\n",
    ended="ended",
)
