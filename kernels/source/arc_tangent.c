/* The angle of a vector in the plane; the arc tangent is that of FreeBSD's msun:

   ====================================================
   Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved.

   Developed at SunPro, a Sun Microsystems, Inc. business.
   Permission to use, copy, modify, and distribute this
   software is freely granted, provided that this notice
   is preserved.
   ==================================================== */
#include "arc_tangent.h"

#include <math.h>

static const double PI_REST = 1.22464679914735317720e-16; /* pi - PI */

/* Arc tangents of 1/2, 1, 3/2 and infinity, and the rests of these rounded numbers. */
static const double ARC[4] = {
    4.63647609000806093515e-01, 7.85398163397448278999e-01, 9.82793723247329054082e-01,
    1.57079632679489655800e+00,
};
static const double ARC_REST[4] = {
    2.26987774529616870924e-17, 3.06161699786838301793e-17, 1.39033110312309984516e-17,
    6.12323399573676603587e-17,
};

/* Coefficients of (x - atan x) / x^3 as a polynomial in x^2, for |x| < 7/16. */
static const double EVEN[6] = {
    3.33333333333329318027e-01, 1.42857142725034663711e-01, 9.09088713343650656196e-02,
    6.66107313738753120669e-02, 4.97687799461593236017e-02, 1.62858201153657823623e-02,
};
static const double ODD[5] = {
    -1.99999999998764832476e-01, -1.11111104054623557880e-01, -7.69187620504482999495e-02,
    -5.83357013379057348645e-02, -3.65315727442169155270e-02,
};

/* atan x for x >= 0, which may be infinite. */
static double arc_tangent(double x)
{
    int at = -1;
    if (x >= 7.378697629483821e19) return ARC[3] + ARC_REST[3]; /* 2^66 */
    if (x >= 2.4375) {
        at = 3;
        x = -1.0 / x;
    } else if (x >= 1.1875) {
        at = 2;
        x = (x - 1.5) / (1.0 + 1.5 * x);
    } else if (x >= 0.6875) {
        at = 1;
        x = (x - 1.0) / (x + 1.0);
    } else if (x >= 0.4375) {
        at = 0;
        x = (2.0 * x - 1.0) / (2.0 + x);
    }
    double z = x * x, w = z * z;
    double even = EVEN[4] + w * EVEN[5], odd = ODD[3] + w * ODD[4];
    for (int i = 3; i >= 0; i--) even = EVEN[i] + w * even;
    for (int i = 2; i >= 0; i--) odd = ODD[i] + w * odd;
    double rest = x * (z * even + w * odd);
    if (at < 0) return x - rest;
    return ARC[at] - ((rest - ARC_REST[at]) - x);
}

double angle_of(double sine, double cosine)
{
    if (isnan(sine) || isnan(cosine)) return sine + cosine;
    if (sine == 0.0) return cosine < 0.0 ? PI : 0.0;
    if (isinf(sine) && isinf(cosine)) return sine - sine; /* no direction */
    double angle = arc_tangent(fabs(sine / cosine)); /* of infinity, if the cosine is zero */
    if (cosine < 0.0) angle = PI - (angle - PI_REST);
    return sine < 0.0 ? -angle : angle;
}
