"""Small FMUs of our own in C: one mass with friction, FMI 2 and 3, both interfaces, and faults.

    x' = v,  v' = (F - Fc tanh(v / 0.01) - Fv v) / m,   outputs x, v and the power F v

A force beyond 900 N makes it misbehave in the way that it was built for.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import zipfile
from functools import cache
from pathlib import Path

import pytest

BAD = {
    "": 0, "segfault": 1, "loop": 2, "exit": 3, "abort": 4, "malloc": 5, "discard": 6,
    "error": 7, "fatal": 8, "nan": 9, "jump": 10, "load": 11, "stack": 12,
}  # fmt: skip

SOURCE = r"""
#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <stdio.h>
#include <unistd.h>
typedef struct {
  double x, v, force, mass, fc, fv, time, x0, v0;
  int hidden;
} Inst;
static double *place(Inst *i, uint32_t r) {
  switch (r) {
    case 1: return &i->force; case 2: return &i->x; case 3: return &i->v;
    case 5: return &i->mass; case 6: return &i->fc; case 7: return &i->fv;
    case 8: return &i->x0; case 9: return &i->v0;
  }
  return 0;
}
static void setup(Inst *i) {
  memset(i, 0, sizeof *i); i->mass = 2.0; i->fc = 1.5; i->fv = 0.5;
}
static void slope(Inst *i, double v, double *dx, double *dv) {
  *dx = v; *dv = (i->force - i->fc * tanh(v / 0.01) - i->fv * v) / i->mass;
#if TIMED
  *dv += 2.0 * cos(3.0 * i->time);
#endif
}
static int deep(volatile int *p) { volatile int a[4096]; a[0] = *p; return deep(a) + 1; }
static int misbehave(Inst *i) {
  if (fabs(i->force) <= 900.0) return 0;
#if BAD == 1
  *(volatile int *)0 = 1;
#elif BAD == 2
  for (;;) { volatile int k = 0; k++; }
#elif BAD == 3
  exit(0);
#elif BAD == 4
  abort();
#elif BAD == 5
  { size_t n = (size_t)64 << 30; volatile char *p = malloc(n);
    for (size_t k = 0; k < n; k += 4096) p[k] = 1; }
#elif BAD == 6
  return 2;
#elif BAD == 7
  return 3;
#elif BAD == 8
  return 4;
#elif BAD == 9
  i->v = 0.0 / 0.0;
#elif BAD == 12
  { volatile int a = 1; i->x = deep(&a); }
#endif
  return 0;
}
static int do_step(Inst *i, double h) {
  int bad = misbehave(i);
  if (bad) return bad;
  double a, b, c, d, e, f, g, k;
  slope(i, i->v, &a, &b); slope(i, i->v + 0.5 * h * b, &c, &d);
  slope(i, i->v + 0.5 * h * d, &e, &f); slope(i, i->v + h * f, &g, &k);
  i->x += h / 6.0 * (a + 2.0 * (c + e) + g); i->v += h / 6.0 * (b + 2.0 * (d + f) + k);
#if HIDDEN
  i->hidden++; i->v += 0.05 * (i->hidden % 3);
#endif
  return 0;
}
static int get(Inst *i, const uint32_t *r, size_t n, double *out) {
  for (size_t k = 0; k < n; k++) {
    if (r[k] == 4) { out[k] = i->force * i->v; continue; }
    if (r[k] == 10) { out[k] = i->v; continue; }
    if (r[k] == 11) { double a; slope(i, i->v, &a, &out[k]); continue; }
    double *p = place(i, r[k]); if (!p) return 3; out[k] = *p;
  }
  return 0;
}
static int set(Inst *i, const uint32_t *r, size_t n, const double *v) {
  for (size_t k = 0; k < n; k++) {
    double *p = place(i, r[k]); if (!p) return 3; *p = v[k];
  }
  return 0;
}
static void begin(Inst *i) {
#if STARTS
  i->x = i->x0; i->v = i->v0;
#endif
}
static void *make(void) {
#if BAD == 11
  *(volatile int *)0 = 1;
#endif
  Inst *i = malloc(sizeof(Inst)); setup(i); return i;
}
#if THREE
const char *fmi3GetVersion(void) { return "3.0"; }
void *fmi3InstantiateCoSimulation(void) { return make(); }
void *fmi3InstantiateModelExchange(void) { return make(); }
void fmi3FreeInstance(void *i) { free(i); }
int fmi3Reset(void *i) { setup(i); return 0; }
int fmi3EnterInitializationMode(Inst *i, bool a, double b, double t) { i->time = t; return 0; }
int fmi3ExitInitializationMode(Inst *i) { begin(i); return 0; }
int fmi3GetFloat64(void *i, const uint32_t *r, size_t n, double *v, size_t m) {
  return get(i, r, n, v);
}
int fmi3SetFloat64(void *i, const uint32_t *r, size_t n, const double *v, size_t m) {
  return set(i, r, n, v);
}
int fmi3DoStep(Inst *i, double t, double h, bool p, bool *e, bool *end, bool *early, double *last) {
  *e = *end = *early = false; *last = t + h; return do_step(i, h);
}
int fmi3EnterEventMode(void *i) { return 0; }
int fmi3EnterContinuousTimeMode(void *i) { return 0; }
int fmi3UpdateDiscreteStates(void *i, bool *a, bool *b, bool *c, bool *d, bool *e, double *t) {
  *a = *b = *c = *d = *e = false; return 0;
}
int fmi3CompletedIntegratorStep(void *i, bool p, bool *a, bool *b) { *a = *b = false; return 0; }
int fmi3SetTime(Inst *i, double t) { i->time = t; return 0; }
int fmi3SetContinuousStates(Inst *i, const double *x, size_t n) {
  i->x = x[0]; i->v = x[1]; return 0;
}
int fmi3GetContinuousStates(Inst *i, double *x, size_t n) { x[0] = i->x; x[1] = i->v; return 0; }
int fmi3GetContinuousStateDerivatives(Inst *i, double *dx, size_t n) {
  int bad = misbehave(i); slope(i, i->v, dx, dx + 1); return bad;
}
int fmi3GetEventIndicators(Inst *i, double *z, size_t n) { if (n) z[0] = i->x + 0.001; return 0; }
int fmi3GetFMUState(Inst *i, void **s) {
  *s = malloc(sizeof *i); memcpy(*s, i, sizeof *i); return 0;
}
int fmi3SetFMUState(Inst *i, void *s) { memcpy(i, s, sizeof *i); return 0; }
int fmi3FreeFMUState(Inst *i, void **s) { free(*s); *s = 0; return 0; }
int fmi3SerializedFMUStateSize(Inst *i, void *s, size_t *n) { *n = sizeof *i; return 0; }
int fmi3SerializeFMUState(Inst *i, void *s, char *b, size_t n) { memcpy(b, s, n); return 0; }
int fmi3DeserializeFMUState(Inst *i, char *b, size_t n, void **s) {
  *s = malloc(n); memcpy(*s, b, n); return 0;
}
#else
typedef struct { int a, b, c, d, e; double t; } Info;
const char *fmi2GetVersion(void) { return "2.0"; }
const char *fmi2GetTypesPlatform(void) { return "default"; }
void *fmi2Instantiate(void) { return make(); }
void fmi2FreeInstance(void *i) { free(i); }
int fmi2Reset(void *i) { setup(i); return 0; }
int fmi2SetupExperiment(Inst *i, int a, double b, double t, int c, double d) {
  i->time = t; return 0;
}
int fmi2EnterInitializationMode(Inst *i) { return 0; }
int fmi2ExitInitializationMode(Inst *i) { begin(i); return 0; }
int fmi2GetReal(void *i, const uint32_t *r, size_t n, double *v) { return get(i, r, n, v); }
int fmi2SetReal(void *i, const uint32_t *r, size_t n, const double *v) { return set(i, r, n, v); }
int fmi2DoStep(Inst *i, double t, double h, int p) { i->time = t; return do_step(i, h); }
int fmi2EnterEventMode(void *i) { return 0; }
int fmi2EnterContinuousTimeMode(void *i) { return 0; }
int fmi2NewDiscreteStates(Inst *i, Info *e) {
  memset(e, 0, sizeof *e);
#if EVENTS
  if (i->x <= 0.0 && i->v < 0.0) { i->v = -0.5 * i->v; e->d = 1; }
#endif
  return 0;
}
int fmi2CompletedIntegratorStep(void *i, int p, int *a, int *b) { *a = *b = 0; return 0; }
int fmi2SetTime(Inst *i, double t) { i->time = t; return 0; }
int fmi2SetContinuousStates(Inst *i, const double *x, size_t n) {
  i->x = x[0]; i->v = x[1]; return 0;
}
int fmi2GetContinuousStates(Inst *i, double *x, size_t n) { x[0] = i->x; x[1] = i->v; return 0; }
int fmi2GetDerivatives(Inst *i, double *dx, size_t n) {
  int bad = misbehave(i); slope(i, i->v, dx, dx + 1); return bad;
}
int fmi2GetEventIndicators(Inst *i, double *z, size_t n) { if (n) z[0] = i->x; return 0; }
int fmi2GetFMUstate(Inst *i, void **s) {
  *s = malloc(sizeof *i); memcpy(*s, i, sizeof *i); return 0;
}
int fmi2SetFMUstate(Inst *i, void *s) { memcpy(i, s, sizeof *i); return 0; }
int fmi2FreeFMUstate(Inst *i, void **s) { free(*s); *s = 0; return 0; }
int fmi2SerializedFMUstateSize(Inst *i, void *s, size_t *n) { *n = sizeof *i; return 0; }
int fmi2SerializeFMUstate(Inst *i, void *s, char *b, size_t n) { memcpy(b, s, n); return 0; }
int fmi2DeSerializeFMUstate(Inst *i, char *b, size_t n, void **s) {
  *s = malloc(n); memcpy(*s, b, n); return 0;
}
#endif
"""

UNITS = "".join(
    f'<Unit name="{name}"><BaseUnit {powers}/></Unit>'
    for name, powers in {
        "N": 'kg="1" m="1" s="-2"', "mm": 'm="1" factor="0.001"', "m": 'm="1"',
        "m/s": 'm="1" s="-1"', "m/s2": 'm="1" s="-2"', "W": 'kg="1" m="2" s="-3"',
        "kg": 'kg="1"', "N.s/m": 'kg="1" s="-1"',
    }.items()
)  # fmt: skip


def compiler() -> str:
    """gcc; without one the test is skipped, and fails under CI."""
    found = shutil.which("gcc") or shutil.which("cc")
    if found is None:
        message = "no C compiler: install gcc to build the FMUs of the tests"
        (pytest.fail if os.environ.get("CI") else pytest.skip)(message)
    return str(found)


@cache
def stubs(three: bool) -> tuple[str, ...]:
    """Names of all functions that the standard asks for and the source does not have."""
    import fmpy.fmi2
    import fmpy.fmi3

    room = fmpy.fmi3 if three else fmpy.fmi2
    prefix = "fmi3" if three else "fmi2"
    kinds = [getattr(room, f"FMU{prefix[-1]}{kind}") for kind in ("Slave", "Model")]
    names = {name for kind in kinds for name in dir(kind) if name.startswith(prefix)}
    return tuple(sorted(name for name in names if f" {name}(" not in SOURCE
                        and f"*{name}(" not in SOURCE))  # fmt: skip


def library(folder: Path, three: bool, bad: str, **flags: int) -> Path:
    """Compiles the shared library."""
    text = SOURCE + "\n".join(f"int {name}(void) {{ return 3; }}" for name in stubs(three))
    source = folder / "mass.c"
    source.write_text(text)
    target = folder / "mass.so"
    defines = {
        "THREE": int(three),
        "BAD": BAD[bad],
        "STARTS": 0,
        "HIDDEN": 0,
        "EVENTS": 0,
        "TIMED": 0,
        **flags,
    }
    subprocess.run(
        [compiler(), "-O1", "-w", "-shared", "-fPIC", "-ffp-contract=off", "-o", str(target),
         str(source), "-lm", *(f"-D{k}={v}" for k, v in defines.items())],
        check=True,
    )  # fmt: skip
    return target


def description(three: bool, interfaces: str, saves: bool, exact: bool, indicators: int = 0) -> str:
    """modelDescription.xml of the mass."""
    state = "State" if three else "state"
    flags = f'canGetAndSetFMU{state}="true" canSerializeFMU{state}="true"' if saves else ""
    tags = "".join(
        f'<{tag} modelIdentifier="mass" {flags}/>'
        for key, tag in (("m", "ModelExchange"), ("c", "CoSimulation")) if key in interfaces
    )  # fmt: skip
    initial = "exact" if exact else "calculated"
    rows = [
        ("force", 1, 'causality="input"', 'start="0" unit="N"'),
        ("x", 2, f'causality="output" initial="{initial}"',
         ('start="0" ' if exact else "") + 'unit="m"'),
        ("v", 3, f'causality="output" initial="{initial}"',
         ('start="0" ' if exact else "") + 'unit="m/s"'),
        ("power", 4, 'causality="output"', 'unit="W"'),
        ("mass", 5, 'causality="parameter" variability="fixed"',
         'start="2" min="0.1" max="50" unit="kg"'),
        ("fc", 6, 'causality="parameter" variability="tunable"', 'start="1.5" min="0" unit="N"'),
        ("fv", 7, 'causality="parameter" variability="tunable"',
         'start="0.5" min="0" unit="N.s/m"'),
        ("x0", 8, 'causality="local" initial="exact" variability="continuous"',
         'start="0" unit="m"'),
        ("v0", 9, 'causality="local" initial="exact" variability="continuous"',
         'start="0" unit="m/s"'),
        ("der(x)", 10, 'causality="local"', 'unit="m/s" derivative="2"'),
        ("der(v)", 11, 'causality="local"', 'unit="m/s2" derivative="3"'),
    ]  # fmt: skip
    if three:
        variables = (
            '<Float64 name="time" valueReference="0" causality="independent" '
            'variability="continuous"/>'
        ) + "".join(f'<Float64 name="{n}" valueReference="{r}" {a} {b}/>' for n, r, a, b in rows)
        structure = (
            "".join(f'<Output valueReference="{r}"/>' for r in (2, 3, 4))
            + "".join(f'<ContinuousStateDerivative valueReference="{r}"/>' for r in (10, 11))
            + "".join(f'<EventIndicator valueReference="{r}"/>' for r in [2][:indicators])
        )
        head = 'fmiVersion="3.0" modelName="mass" instantiationToken="{m}"'
    else:
        variables = "".join(
            f'<ScalarVariable name="{n}" valueReference="{r}" {a}><Real {b}/></ScalarVariable>'
            for n, r, a, b in rows
        )
        structure = (
            "<Outputs>" + "".join(f'<Unknown index="{r}"/>' for r in (2, 3, 4)) + "</Outputs>"
            "<Derivatives>" + "".join(f'<Unknown index="{r}"/>' for r in (10, 11))
            + "</Derivatives>"
        )  # fmt: skip
        head = (
            f'fmiVersion="2.0" modelName="mass" guid="{{m}}" numberOfEventIndicators="{indicators}"'
        )
    return (
        f'<?xml version="1.0"?><fmiModelDescription {head}>{tags}'
        f'<UnitDefinitions>{UNITS}</UnitDefinitions><DefaultExperiment stepSize="0.01"/>'
        f"<ModelVariables>{variables}</ModelVariables>"
        f"<ModelStructure>{structure}</ModelStructure></fmiModelDescription>"
    )


def build(
    folder: Path, *, three: bool = False, interfaces: str = "cm", bad: str = "",
    saves: bool = False, exact: bool = True, indicators: int = 0, name: str = "mass", **flags: int,
) -> Path:  # fmt: skip
    """A mass as an FMU file."""
    folder.mkdir(parents=True, exist_ok=True)
    binary = library(folder, three, bad, **flags)
    target = folder / f"{name}.fmu"
    where = "x86_64-linux" if three else "linux64"
    with zipfile.ZipFile(target, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr(
            "modelDescription.xml", description(three, interfaces, saves, exact, indicators)
        )
        archive.write(binary, f"binaries/{where}/mass.so")
    return target
