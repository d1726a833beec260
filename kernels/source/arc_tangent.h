/* The angle of a vector in the plane, in (-pi, pi].

   The C libraries of the platforms round theirs differently, which would lead to different curves
   on different platforms. This one needs only +, -, * and /. */
#ifndef NICMM_ARC_TANGENT_H
#define NICMM_ARC_TANGENT_H

#define PI 3.14159265358979311600e+00 /* rounded */

double angle_of(double sine, double cosine);

#endif
