/* One axis of docs/reference/reference-stage.md in closed loop, without noise and effects: GMS friction, PID on
   the encoder, a current loop of first order. `reference` makes SUBSTEPS steps per control tick,
   `coarse` one (hil_sim/plant/coarse.py). Plain C, written from the equations. */
#include <math.h>
#include <string.h>

#define MOST 64

typedef struct {
    double mass, viscous, coulomb, static_ratio, stribeck_velocity, stribeck_shape, stribeck_end;
    double stiffness, relaxation_rate, increment, current_gain;
    double kp, ki, kd, derivative_time, peak_force, period, unit;
    double share, mean_start, early_start, end_start; /* of the coarse step */
    long elements, ticks, substeps;
} Axis;

typedef struct {
    double x, v, motor, friction, direction, encoder;
    double demand, offset, from_x, to_x, from_f, to_f, integral, derivative, last_error, output;
    double force[MOST], nu[MOST];
    int slipping[MOST];
    long done;
} State;

static void begin(const Axis *p, State *s, double x, double offset) {
    memset(s, 0, sizeof *s);
    for (long i = 0; i < p->elements; i++)
        s->nu[i] = 2.0 * (i + 1) / (p->elements * (p->elements + 1.0));
    s->x = x;
    s->encoder = s->demand = s->from_x = s->to_x = nearbyint(x / p->increment) * p->increment;
    s->offset = s->from_f = s->to_f = offset;
}

static void control(const Axis *p, State *s) {
    if (s->done < p->ticks) {
        double part = (double)++s->done / p->ticks;
        s->demand = s->from_x + (s->to_x - s->from_x) * part;
        s->offset = s->from_f + (s->to_f - s->from_f) * part;
    }
    double error = s->demand - s->encoder;
    double rate = (error - s->last_error) / p->period;
    s->last_error = error;
    s->derivative += p->period / (p->derivative_time + p->period) * (rate - s->derivative);
    double raw = p->kp * error + s->integral + p->kd * s->derivative + s->offset;
    s->output = fmin(fmax(raw, -p->peak_force), p->peak_force);
    if (raw == s->output || (raw > s->output) != (error > 0.0))
        s->integral += p->ki * error * p->period;
}

static double stribeck(const Axis *p, double v) {
    double ratio = fabs(v) / p->stribeck_velocity;
    if (p->stribeck_shape != 1.0) ratio = pow(ratio, p->stribeck_shape);
    return 1.0 + p->static_ratio * exp(-ratio);
}

static double slip(const Axis *p, State *s, double dx, double level, double decay) {
    double direction = copysign(1.0, dx), total = 0.0;
    if (direction != s->direction) {
        s->direction = direction;
        memset(s->slipping, 0, sizeof s->slipping);
    }
    for (long i = 0; i < p->elements; i++) {
        double limit = s->nu[i] * level, force = s->force[i];
        if (!s->slipping[i]) {
            double stretched = force + p->stiffness * dx;
            if (stretched * direction >= limit) {
                s->slipping[i] = 1;
                force = direction * fmax(limit, force * direction);
            } else
                force = stretched;
        }
        if (s->slipping[i]) force = direction * limit + (force - direction * limit) * decay;
        s->force[i] = force;
        total += force;
    }
    return total;
}

static void fine_tick(const Axis *p, State *s) {
    double dt = p->period / p->substeps;
    for (long k = 0; k < p->substeps; k++) {
        s->motor += p->current_gain * (s->output - s->motor);
        s->v += dt / p->mass * (s->motor - s->friction - p->viscous * s->v);
        s->x += s->v * dt;
        if (s->v != 0.0) {
            double curve = stribeck(p, s->v);
            s->friction = slip(p, s, s->v * dt, p->coulomb * curve,
                               exp(-p->relaxation_rate * dt / curve));
        }
    }
}

static double decayed(double y) {
    if (y > 0.05) return exp(-y);
    return 1.0 - y * (1.0 - y * (0.5 - y * (1.0 / 6.0 - y / 24.0)));
}

static void coarse_tick(const Axis *p, State *s) {
    double dt = p->period, lag = s->motor - s->output;
    double mean = s->output + p->mean_start * lag;
    double early = p->share * s->output + p->early_start * lag;
    s->motor = s->output + p->end_start * lag;
    double kick = dt * (mean - s->friction - p->viscous * s->v) / p->mass;
    double lead = dt * (early - p->share * mean) / p->mass;
    double speed = s->v + p->share * kick + lead, dx = dt * speed, change = p->viscous * kick;
    s->x += dx;
    if (dx != 0.0) {
        double curve = fabs(speed) < p->stribeck_end ? stribeck(p, speed) : 1.0;
        double friction = slip(p, s, dx, p->coulomb * curve,
                               decayed(p->relaxation_rate * dt / curve));
        change += friction - s->friction;
        s->friction = friction;
    }
    s->v += kick - dt / p->mass * (1.0 - p->share) * change;
}

void run(const Axis *p, const double *demand, const double *offset, long count, double *position,
         double *force) {
    State s;
    begin(p, &s, demand[0], offset[0]);
    for (long k = 0; k < count; k++) {
        position[k] = s.encoder;
        force[k] = p->unit > 0.0 ? nearbyint(s.motor / p->unit) * p->unit : s.motor;
        s.from_x = s.demand, s.to_x = demand[k];
        s.from_f = s.offset, s.to_f = offset[k];
        s.done = 0;
        for (long tick = 0; tick < p->ticks; tick++) {
            control(p, &s);
            if (p->substeps == 1)
                coarse_tick(p, &s);
            else
                fine_tick(p, &s);
            s.encoder = nearbyint(s.x / p->increment) * p->increment;
        }
    }
}
