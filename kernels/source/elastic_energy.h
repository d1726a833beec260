/* The energy of a curve and its Gauss-Newton system; nicmm_core/relaxation/elastic_energy.py
   explains both. */
#ifndef NICMM_ELASTIC_ENERGY_H
#define NICMM_ELASTIC_ENERGY_H

#include "contact.h"
#include "nodes.h"

typedef struct {
    double smoothness;   /* divisor of the tension and of the weight of a map */
    double tautness;     /* factor of the tension, but not of the weight of a map */
    double over_tension; /* multiple of the tension added to the weight of a map */
    double contact;      /* contact energy of a curve whose strands touch everywhere, relative to
                            its energy without maps; 0 if strands may cross */
} EnergyRules;

/* Weights of the energy terms of one curve. */
typedef struct {
    double tension;        /* in 1/length^2 */
    double contact;        /* in 1/length; 0 where strands may cross */
    double feature;        /* of the map, in 1/length^2; 0 without a map */
    double normal_bending; /* of the normal curvature, squared; that of the geodesic one is 1 */
    const double *frozen_ds; /* (n) ds, held constant in the term of lanes; NULL without a map */
} Weights;

/* Half the derivatives of the energy by moves of the n nodes along their conormals. */
typedef struct {
    double *bands; /* (3, n) symmetric matrix: entries (i, i), (i, i + 1), (i, i + 2) modulo n */
    double *slope; /* (n) first derivatives */
} System;

/* Residuals of the nodes and their derivatives, from which a system is assembled. */
typedef struct {
    double *residuals; /* (n, 2) sqrt(kappa^2 ds) with its sign, and sqrt(tension ds) */
    double *jacobian;  /* (n, 3, 2) derivatives by the moves of nodes i - 1, i and i + 1 */
    double *drift;     /* (n) derivatives of phi_fea at each node by its own move */
    double *normal_turns; /* (n, 3) derivatives of the normal at each node by its own move */
} Linearisation;

int64_t items_of_system(int64_t n);
int take_system(Scratch *scratch, int64_t n, System *system);
int64_t items_of_linearisation(int64_t n);
int take_linearisation(Scratch *scratch, int64_t n, Linearisation *linearisation);

/* Weights for the present nodes; `frozen_ds`, (n), becomes their ds if there is a map. */
Weights balance(const Surface *surface, const Nodes *nodes, const EnergyRules *rules,
                double *frozen_ds);

/* Integral of the normal curvature, squared, along the step after a node, in 1/length. */
double normal_bending_of_step(const Nodes *nodes, int64_t i);

/* Energy without contact. */
double elastic_energy(const Nodes *nodes, const Weights *weights);

/* Assembles the system without contact. `shortest` is the least length of a step that divides. */
int assemble_system(const Surface *surface, const Nodes *nodes, const Weights *weights,
                    double shortest, const Linearisation *linearisation, const System *system);

double contact_energy(const Contacts *contacts, const Weights *weights);

/* Derivatives of the normals, (n, 3), and of phi_fea, (n), by moves along the conormals. */
EXPORTED int conormal_derivatives(const Surface *surface, const Nodes *nodes, double *turns,
                                  double *drifts);

/* Adds contact to a system, with diagonal entries only, so that the matrix stays banded. They
   overestimate the stiffness, since 2 (a^2 + b^2) is never less than (a + b)^2. */
int add_contact(const Nodes *nodes, const Contacts *contacts, const Weights *weights,
                const System *system);

#endif
