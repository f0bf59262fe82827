"""The test program of an export in C: plays the vectors to the block and compares."""

from __future__ import annotations

from softstart.export.vectors import WHOLE, Vectors

PROGRAM = r"""/* Test of {P}: plays vectors.csv to the block and compares torque and fault.

   cc -std=c99 -O2 -ffp-contract=off test_{P}.c {P}.c -lm -o test_{P} && ./test_{P} vectors.csv
   Exit code 0: all equal; 1: a difference; 2: the file cannot be read. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include "{P}.h"

#define ROOM {room} /* N m by which a torque may be off; above 0 the rows beside it count too */
#define COLUMNS "{columns}"
#define SHOWN 5

typedef struct {{
    char scenario[32];
    {P}_Input input;
    double torque;
    long fault;
}} Row;

/* The text of the next cell; the comma behind it becomes the end of the text. */
static char *cell(char **place)
{{
    char *begin = *place;
    char *end = begin + strcspn(begin, ",\r\n");
    *place = *end == '\0' ? end : end + 1;
    *end = '\0';
    return begin;
}}

static void read_row(char *line, Row *row)
{{
    char *place = line;
    memset(row, 0, sizeof(*row));
    sprintf(row->scenario, "%.31s", cell(&place));
{fields}    row->torque = strtod(cell(&place), NULL);
    row->fault = strtol(cell(&place), NULL, 10);
}}

/* All rows of the file; NULL if it cannot be read. */
static Row *read_rows(const char *name, size_t *count)
{{
    char line[1024];
    size_t room = 1024;
    FILE *file = fopen(name, "r");
    Row *rows = file == NULL ? NULL : malloc(room * sizeof(Row));
    *count = 0;
    if (rows == NULL || fgets(line, sizeof(line), file) == NULL) {{
        return NULL;
    }}
    line[strcspn(line, "\r\n")] = '\0';
    if (strcmp(line, COLUMNS) != 0) {{
        return NULL;
    }}
    while (fgets(line, sizeof(line), file) != NULL) {{
        if (*count == room) {{
            Row *more = realloc(rows, 2 * room * sizeof(Row));
            if (more == NULL) {{
                return NULL;
            }}
            rows = more;
            room *= 2;
        }}
        read_row(line, &rows[(*count)++]);
    }}
    fclose(file);
    return rows;
}}

static int same_scenario(const Row *rows, size_t count, size_t k, long beside)
{{
    const long other = (long)k + beside;
    return other >= 0 && other < (long)count && strcmp(rows[other].scenario, rows[k].scenario) == 0;
}}

/* By how much a torque is off, N m; 0 within the room. INFINITY for another fault. */
static double off(const Row *rows, size_t count, size_t k, const {P}_Output *output)
{{
    const double torque = (double)output->torque;
    double low = rows[k].torque, high = rows[k].torque;
    int known = (long)output->fault == rows[k].fault;
    long beside;
    for (beside = -1; ROOM > 0.0 && beside <= 1; beside += 2) {{
        if (same_scenario(rows, count, k, beside)) {{
            const Row *row = &rows[(long)k + beside];
            low = row->torque < low ? row->torque : low;
            high = row->torque > high ? row->torque : high;
            known = known || (long)output->fault == row->fault;
        }}
    }}
    if (!known || torque != torque) {{
        return INFINITY;
    }}
    if (torque >= low - ROOM && torque <= high + ROOM) {{
        return 0.0;
    }}
    return torque < low ? low - torque : torque - high;
}}

int main(int arguments, char **argument)
{{
    size_t count, k, differing = 0;
    double worst = 0.0;
    long steps = 0;
    volatile double kept = 0.0;
    clock_t began;
    {P}_State state;
    {P}_Output output;
    Row *rows = read_rows(arguments > 1 ? argument[1] : "vectors.csv", &count);
    if (rows == NULL || count == 0) {{
        fprintf(stderr, "test_{P}: no vectors of this block in the file\n");
        return 2;
    }}
    for (k = 0; k < count; k++) {{
        double difference;
        if (k == 0 || strcmp(rows[k].scenario, rows[k - 1].scenario) != 0) {{
            {P}_init(&state);
        }}
        {P}_step(&state, &rows[k].input, &output);
        difference = off(rows, count, k, &output);
        if (difference > 0.0) {{
            if (differing++ < SHOWN) {{
                printf("row %lu (%s): torque %.17g N m, fault %ld; expected %.17g N m, fault %ld\n",
                       (unsigned long)k + 2, rows[k].scenario, (double)output.torque, (long)output.fault,
                       rows[k].torque, rows[k].fault);
            }}
            worst = difference > worst ? difference : worst;
        }}
    }}
    began = clock();
    do {{
        {P}_init(&state);
        for (k = 0; k < count; k++, steps++) {{
            {P}_step(&state, &rows[k].input, &output);
            kept += (double)output.torque;
        }}
    }} while (clock() - began < CLOCKS_PER_SEC / 5);
    printf("{P}: %lu rows, %lu differ; largest difference %.17g N m; state %lu bytes; %.0f ns a step\n",
           (unsigned long)count, (unsigned long)differing, worst, (unsigned long)sizeof(state),
           1e9 * (double)(clock() - began) / CLOCKS_PER_SEC / (double)steps);
    free(rows);
    return differing > 0;
}}
"""

MAKEFILE = """\
# make test: compiles the block and its test, and plays vectors.csv to it
CC = cc
CFLAGS = -std=c99 -O2 -Wall -Wextra -Werror -ffp-contract=off

test: test_{P}
\t./test_{P} vectors.csv

test_{P}: test_{P}.c {P}.c {P}.h
\t$(CC) $(CFLAGS) -o $@ test_{P}.c {P}.c -lm

clean:
\trm -f test_{P}

.PHONY: test clean
"""


def test_program(prefix: str, vectors: Vectors) -> dict[str, str]:
    """The test program of a block in C and its Makefile, by file name.

    >>> from softstart.export.vectors import Vectors
    >>> sorted(test_program("ramp", Vectors(("cycles", "run"), ())))
    ['Makefile', 'test_ramp.c']
    """
    fields = "".join(f"    row->input.{name} = {_read(name, prefix)};\n" for name in vectors.inputs)
    program = PROGRAM.format(
        P=prefix, room=repr(vectors.room), columns=",".join(vectors.columns), fields=fields
    )
    return {f"test_{prefix}.c": program, "Makefile": MAKEFILE.format(P=prefix)}


test_program.__test__ = False  # type: ignore[attr-defined]  # pytest takes it for a test


def _read(name: str, prefix: str) -> str:
    if name in WHOLE:
        return "strtol(cell(&place), NULL, 10)"
    if name == "run":
        return "strtol(cell(&place), NULL, 10) != 0"
    kind = "double" if name == "motor_angle" else f"{prefix}_real"
    return f"({kind})strtod(cell(&place), NULL)"
