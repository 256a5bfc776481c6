/* The steady state of a circularly towed cable as a problem of AUTO-07p.

   u = (x, y, z, F_x, F_y, F_z): position and tension vector of an inextensible cable without
   buoyancy, over the share of arc length from the end mass; thesis (2.11)-(2.16) with the errata
   of docs/thesis.md. START_OMEGA, START_RADIUS (omega and end-mass radius of a steady state) and
   the other parameters are defined when this is compiled. Derivatives are left to AUTO: given by
   hand they change its time by less than 5 %, which goes into its linear algebra. */
#include <math.h>
#include <stdlib.h>
#include "auto_f2c.h"

/* AUTO's parameters; the first two vary. */
enum { OMEGA, RADIUS, CABLE_DRAG, END_MASS, DRAG_RATIO, LENGTH };
#define SIZE 6
#define STEPS 400

static int func(integer ndim, const doublereal *u, const integer *icp, const doublereal *par,
                integer ijac, doublereal *f, doublereal *dfdu, doublereal *dfdp)
{
    const double omega = par[OMEGA], o2 = omega * omega, l = par[LENGTH];
    const double p = sqrt(u[3] * u[3] + u[4] * u[4] + u[5] * u[5]);
    const double t[3] = {u[3] / p, u[4] / p, u[5] / p};
    const double v[3] = {-u[1], u[0], 0.0};
    const double along = v[0] * t[0] + v[1] * t[1];
    const double n[3] = {v[0] - along * t[0], v[1] - along * t[1], -along * t[2]};
    const double q = sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    const double c = o2 * par[CABLE_DRAG];
    int i;
    for (i = 0; i < 3; i++) {
        f[i] = l * t[i];
        f[3 + i] = l * (c * q * n[i] + (i < 2 ? -o2 * u[i] : 1.0));
    }
    return 0;
}

/* What every quantity at the end mass must be, (2.15)-(2.16). */
static void end_mass(const doublereal *par, double *u)
{
    const double o2 = par[OMEGA] * par[OMEGA], x = par[RADIUS];
    u[0] = x;
    u[1] = u[2] = 0.0;
    u[3] = -o2 * par[END_MASS] * x;
    u[4] = o2 * par[DRAG_RATIO] * par[CABLE_DRAG] * x * x;
    u[5] = par[END_MASS];
}

/* The first solution, by the classical Runge-Kutta method from the end mass up. */
static int stpnt(integer ndim, doublereal s, doublereal *u, doublereal *par)
{
    static const double node[4] = {0.0, 0.5, 0.5, 1.0};
    const int steps = (int)ceil(STEPS * s);
    const double h = steps > 0 ? s / steps : 0.0;
    double k[4][SIZE], at[SIZE];
    int i, j, m;
    par[OMEGA] = START_OMEGA;
    par[RADIUS] = START_RADIUS;
    par[CABLE_DRAG] = START_CABLE_DRAG;
    par[END_MASS] = START_END_MASS;
    par[DRAG_RATIO] = START_DRAG_RATIO;
    par[LENGTH] = START_LENGTH;
    end_mass(par, u);
    for (i = 0; i < steps; i++) {
        for (j = 0; j < 4; j++) {
            for (m = 0; m < SIZE; m++)
                at[m] = u[m] + (j > 0 ? h * node[j] * k[j - 1][m] : 0.0);
            func(SIZE, at, NULL, par, 0, k[j], NULL, NULL);
        }
        for (m = 0; m < SIZE; m++)
            u[m] += h / 6.0 * (k[0][m] + 2.0 * k[1][m] + 2.0 * k[2][m] + k[3][m]);
    }
    return 0;
}

static int bcnd(integer ndim, const doublereal *par, const integer *icp, integer nbc,
                const doublereal *u0, const doublereal *u1, integer ijac, doublereal *fb,
                doublereal *dbc)
{
    double end[SIZE];
    int i;
    end_mass(par, end);
    for (i = 0; i < SIZE; i++)
        fb[i] = u0[i] - end[i];
    fb[6] = u1[0] * u1[0] + u1[1] * u1[1] - 1.0;
    return 0;
}

static int icnd(integer ndim, const doublereal *par, const integer *icp, integer nint,
                const doublereal *u, const doublereal *uold, const doublereal *udot,
                const doublereal *upold, integer ijac, doublereal *fi, doublereal *dint)
{
    return 0;
}

static int fopt(integer ndim, const doublereal *u, const integer *icp, const doublereal *par,
                integer ijac, doublereal *fs, doublereal *dfdu, doublereal *dfdp)
{
    return 0;
}

static int pvls(integer ndim, const doublereal *u, doublereal *par)
{
    return 0;
}

/* Of a Fortran runtime older than AUTO's objects this is missing; it reports a failed malloc. */
__attribute__((weak)) void _gfortran_os_error_at(const char *where, const char *text, ...)
{
    abort();
}
