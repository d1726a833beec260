/* Levenberg-Marquardt steps, which move nodes along conormals and lower the energy. */
#ifndef NICMM_LEVENBERG_MARQUARDT_H
#define NICMM_LEVENBERG_MARQUARDT_H

#include "contact.h"
#include "damped_step.h"
#include "elastic_energy.h"
#include "even_nodes.h"
#include "tracing.h"

/* Lengths are in mean distances between neighbouring nodes. */
typedef struct {
    int64_t steps;         /* greatest number of steps that lower the energy; with 0, it is only
                              found out whether a step is worthwhile */
    int64_t tries;         /* greatest number of trial steps until one of them does */
    int64_t doubles;       /* whether a step is doubled if the energy falls far */
    double longest_move;   /* trust radius of the linearised energy */
    double least_damping;  /* lower bound of the damping */
    double most_damping;   /* damping above which no step is tried */
    double damping_factor; /* by which damping rises after a failed step, and falls otherwise */
    double shortest;       /* least length of a step by which the tension is divided, in mesh
                              units */
} StepRules;

typedef struct {
    TraceLimits traces;
    ContactRules contact;
    SpacingRules spacing;
    EnergyRules energy;
    StepRules steps;
} RelaxationRules;

/* Everything that the steps of one curve need. */
typedef struct {
    Nodes now, trial, farther;
    Contacts contacts;
    Linearisation linearisation;
    System system;
    double *frozen_ds;  /* (n) */
    double *moves;    /* (n) */
    uint8_t *fixed;   /* (n) nodes that do not move; those that reach a boundary are added */
    uint8_t *blocked; /* (n) nodes of the trial that have reached a boundary */
    Scratch rest;     /* of damped steps, and for others */
} Workspace;

/* What the steps have found and done. */
typedef struct {
    double damping;  /* of the next trial step; given and changed */
    double before;   /* energy at the beginning, with contact */
    double after;    /* energy now */
    double scale;    /* the energy at the beginning, without a map and contact if there is a map,
                        since the term of a lane is negative */
    double farthest; /* sum of the greatest moves of all trials, in mean steps */
    int64_t taken;   /* number of steps that lowered the energy */
    int64_t is_negligible; /* whether the predicted decrease was too small for the first one */
} Steps;

int64_t items_of_workspace(int64_t n, int64_t pair_room);
int take_workspace(Scratch scratch, int64_t n, int64_t closed, int64_t pair_room,
                   Workspace *space);

/* The nodes at which the curve may turn freely, (n); or NULL. */
void set_corners(Workspace *space, const uint8_t *is_corner);

/* The trial nodes become the present ones. */
void take_trial(Workspace *space);

/* Computes positions, normals and measures of the present nodes from their places. */
int locate_nodes(const Surface *surface, const Nodes *nodes);

/* Moves the present nodes along their conormals by `moves` times a share; the result is `moved`.
   `work` is raised by the faces passed, and those that take as much time as the rest. */
int move_nodes(const Surface *surface, const TraceLimits *limits, const Workspace *space,
               double share, const Nodes *moved, int64_t *work);

/* Energy of nodes, with contact unless strands may cross. */
int energy_with_contact(const RelaxationRules *rules, const Nodes *nodes, const Weights *weights,
                        Contacts *contacts, double *energy);

/* Number of faces that take as much time to cross as the rest of a step of one node. */
#define FACES_OF_A_NODE 4

/* Takes steps as long as they are worthwhile. With the same weights for all of them, every step
   lowers the energy. It stops when `work` has reached `most_work`.

   negligible : predicted decrease up to which no step is taken; relative to the bending energy, or
       to a small part of the scale if that is more */
int take_steps(const Surface *surface, const RelaxationRules *rules, double negligible,
               int64_t most_work, Workspace *space, Steps *found, Weights *weights, int64_t *work);

/* Bending energy of a curve, in 1/length; the normal curvature counts with a weight. */
double bending_energy(const Nodes *nodes, double normal_bending);

/* The value that decreases are compared with: the bending energy, or a small part of the scale. */
double scale_of_decrease(const Nodes *nodes, const Steps *found, const Weights *weights);

#endif
