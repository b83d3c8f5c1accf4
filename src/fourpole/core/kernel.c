/* What kernel.py hands over: plain decimals of a table of text, and the fit of sines to a track. The same as in numpy,
   which remains where there is no compiler, and wherever a function here says so. C99, without Python.h.
   Arrays are contiguous, of double, of complex double, or of int64_t; kernel.py sees to that. */

#include <complex.h>
#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#if FLT_EVAL_METHOD != 0
#error "double arithmetic with more digits rounds a decimal twice"
#endif
#if defined(__x86_64__) && defined(__gnu_linux__)
#define WIDE __attribute__((flatten, target_clones("avx2", "default")))
#else
#define WIDE
#endif

typedef ptrdiff_t size;

enum { EXACT = 22, DIGITS = 19, DRIFT = 4, POWERS = 7, SERIES = 8 };
/* What fp_fit returns: FAR if it needs moments at its frequencies, NUMPY if numpy must do it. */
enum { DONE, FAR, NUMPY };
/* As in sums.py and sinefit.py. */
static const double PI = 3.14159265358979323846, FEWEST = 0.5, NEAR = 0.15, ROUND_OFF = 1e-14, ALIKE = 1e-3;
static const double LEFT = 1e-3, LEFT_OVER = 3, BENT = 0.3, LONGEST = 0.3;
static const double TEN[EXACT + 1] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                      1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};

/* Read digits into *value; returns how many. */
static size digits(const unsigned char **at, const unsigned char *end, uint64_t *value)
{
    const unsigned char *now = *at;
    for (; now < end && (unsigned)(*now - '0') <= 9; now++)
        *value = *value * 10 + (*now - '0');
    size count = now - *at;
    *at = now;
    return count;
}

static int sign(const unsigned char **at, const unsigned char *end)
{
    int negative = *at < end && **at == '-';
    *at += *at < end && (**at == '-' || **at == '+');
    return negative;
}

/* Plain decimals of a table of text -> columns (columns, room); column k goes to place[k], or nowhere if that is -1.
   Returns the number of rows; -1 if a cell or a row is not plain, or its nearest double is not certain: a mantissa
   below 2^53 times or over a power of ten up to 22 is rounded once. */
size fp_cells(const unsigned char *at, size length, int separator, int ending, int decimal, size width,
              const int64_t *place, double *columns, size room)
{
    const unsigned char *end = at + length;
    size row = 0;
    for (; at < end; row++) {
        if (row == room)
            return -1;
        for (size k = 0; k < width; k++) {
            if (place[k] < 0) {
                while (at < end && *at != separator && *at != ending)
                    at++;
            } else {
                uint64_t mantissa = 0, exponent = 0;
                int negative = sign(&at, end), down = 0;
                size count = digits(&at, end, &mantissa), power = 0;
                if (at < end && *at == decimal) {
                    at++;
                    power = -digits(&at, end, &mantissa);
                }
                if (count - power == 0 || count - power > DIGITS)
                    return -1;
                if (at < end && (*at | 32) == 'e') {
                    at++;
                    down = sign(&at, end);
                    count = digits(&at, end, &exponent);
                    if (count == 0 || count > 3)
                        return -1;
                }
                power += down ? -(size)exponent : (size)exponent;
                if (mantissa >> 53 || power > EXACT || power < -EXACT)
                    return -1;
                double value = power < 0 ? (double)mantissa / TEN[-power] : (double)mantissa * TEN[power];
                columns[place[k] * room + row] = negative ? -value : value;
            }
            int last = k + 1 == width;
            at += last && end - at > 1 && at[0] == '\r' && at[1] == ending;
            if (at == end ? !last : *at != (last ? ending : separator))
                return -1;
            at += at < end;
        }
    }
    return row;
}

/* --- the fit of sines to one track: see terms.py and sinefit.py --- */

/* terms._Layout: n rows, the first P of which are fitted, of S sines. */
typedef struct {
    size n, P, S;
    const int64_t *seconds, *frequency, *power, *kept, *below, *above;
    const double *rows, *of_below, *of_above;
} Layout;

/* A track of C channels and N samples, with the moments (C, 3, SERIES) of its samples at some frequencies. */
typedef struct {
    size C, N, bases;
    double rate, half, length;
    const double *base, *drift, *by_sine, *by_cosine, *still;
    const double complex *moments;
} Track;

/* sinefit.SineFit of H harmonics and L lines, with at most `rounds` steps; `step` (1 + L) is the last of them. */
typedef struct {
    size H, L, rounds, free;
    const double *energy, *informing, *weight;
    double *omega, *lines, *step, *std;
    double *inner, *inverse, *coefficients, *rest, *variance;
} Fit;

/* out (n, n) = rows (n, n), which are nearly diagonal, times a table (n, m). */
static void times(size n, size m, const double *rows, const double *table, double *out)
{
    memset(out, 0, n * m * sizeof(double));
    for (size i = 0; i < n; i++)
        for (size k = 0; k < n; k++) {
            double share = rows[i * n + k];
            if (share != 0)
                for (size j = 0; j < m; j++)
                    out[i * m + j] += share * table[k * m + j];
        }
}

/* Sums without samples at one frequency, sums_without_samples: powers 0 to 6 at steps of `stride`; 0 if the frequency
   is so low that they have no closed form. */
static int closed(const Track *t, double frequency, double *sums, size stride)
{
    double x = frequency / (2 * t->rate), sine = sin(x), N = (double)t->N, power = 1 / sine, powers[POWERS];
    if (frequency == 0) {
        for (size p = 0; p < POWERS; p++)
            sums[p * stride] = t->still[p];
        return 1;
    }
    if (fabs(sine) * N < FEWEST)
        return 0;
    double step = cos(x) / sine / (N - 1), many = sin(N * x), few = cos(N * x);
    for (size p = 0; p < POWERS; p++, power *= step) {
        double s = 0, c = 0;
        powers[p] = power;
        for (size q = 0; q <= p; q++) {
            s += t->by_sine[p * POWERS + q] * powers[q];
            c += t->by_cosine[p * POWERS + q] * powers[q];
        }
        sums[p * stride] = many * s + few * c;
    }
    return 1;
}

/* Inner products (n, n) of the rows; 0 if they are left to numpy. */
static int products(const Layout *l, const Track *t, const Fit *f, double *work, double *inner)
{
    size n = l->n, K = 0, still = 2 * f->H + 1, others = f->H + f->L + 1, count = still + 2 * f->L * others;
    double *sums = work, *flat = work + POWERS * count, half = t->half;
    for (; K < still; K++) /* Terms.differences */
        if (!closed(t, *f->omega * K, sums + K, count))
            return 0;
    for (size k = 0; k < f->L; k++)
        for (int sign = 1; sign >= -1; sign -= 2)
            for (size i = 0; i < others; i++, K++) {
                double other = i <= f->H ? *f->omega * i : f->lines[i - f->H - 1];
                if (!closed(t, other + sign * f->lines[k], sums + K, count))
                    return 0;
            }
    for (size i = 0; i < n * n; i++)
        inner[i] = l->of_below[i] * sums[l->below[i]] + l->of_above[i] * sums[l->above[i]];
    times(n, n, l->rows, inner, flat);
    for (size i = 0; i < n; i++)
        for (size j = 0; j < n; j++)
            inner[j * n + i] = flat[i * n + j];
    times(n, n, l->rows, inner, flat);
    double scale[5] = {1, half, half * half, half * half * half, half * half * half * half};
    for (size i = 0; i < n; i++)
        for (size j = 0; j < n; j++)
            inner[i * n + j] = flat[i * n + j] * scale[l->seconds[i] + l->seconds[j]];
    return 1;
}

/* Inner products (n, C) of the rows with the channels, from the moments at the nearest frequency; 0 if none is near. */
static int with_signals(const Layout *l, const Track *t, const Fit *f, double *work, double *right)
{
    size C = t->C, sines = l->S + 1;
    double complex *sums = (double complex *)work; /* (C, DRIFT, S + 1) */
    double *flat = work + 2 * C * DRIFT * sines;
    for (size s = 0; s < l->S; s++) {
        double omega = s < f->H ? *f->omega * (s + 1) : f->lines[s - f->H];
        size near = 0;
        for (size b = 1; b < t->bases; b++)
            near = fabs(omega - t->base[b]) < fabs(omega - t->base[near]) ? b : near;
        double turn = (omega - t->base[near]) * t->half;
        if (!(fabs(turn) <= NEAR))
            return 0;
        for (size c = 0; c < C; c++)
            for (size o = 0; o < 3; o++) {
                const double complex *x = t->moments + (c * 3 + o) * SERIES * t->bases + near;
                double complex share = 1, sum = 0;
                for (size e = 0; e < SERIES; share *= -I * turn / (double)++e, x += t->bases)
                    sum += share * *x;
                sums[(c * DRIFT + o) * sines + s] = sum;
            }
    }
    for (size i = 0; i < C * DRIFT; i++)
        sums[i * sines + l->S] = t->drift[i];
    for (size i = 0; i < l->n; i++) {
        size atom = l->kept[i] / 2, part = l->kept[i] % 2;
        for (size c = 0; c < C; c++) {
            double complex sum = sums[(c * DRIFT + l->power[atom]) * sines + l->frequency[atom]];
            flat[i * C + c] = part ? cimag(sum) : creal(sum);
        }
    }
    times(l->n, C, l->rows, flat, right);
    for (size i = 0; i < l->n * C; i++)
        for (size p = 0; p < l->seconds[i / C]; p++)
            right[i] *= t->half;
    return 1;
}

/* Inverse (P, P) of the first rows of a positive table (n, n); 0 if it is nearly singular. */
static int inverted(size n, size P, double least, const double *table, double *L, double *inverse)
{
    for (size i = 0; i < P; i++)
        for (size j = 0; j <= i; j++) {
            double sum = table[i * n + j];
            for (size k = 0; k < j; k++)
                sum -= L[i * P + k] * L[j * P + k];
            if (i == j && !(sum > least * table[i * n + i]))
                return 0;
            L[i * P + j] = i == j ? 1 / sqrt(sum) : sum * L[j * P + j];
        }
    for (size i = 0; i < P; i++)
        for (size j = 0; j < i; j++) {
            double sum = 0;
            for (size k = j; k < i; k++)
                sum -= L[i * P + k] * L[k * P + j];
            L[i * P + j] = sum * L[i * P + i];
        }
    memset(inverse, 0, P * P * sizeof(double));
    for (size k = 0; k < P; k++)
        for (size i = 0; i <= k; i++)
            for (size j = 0; j <= k; j++)
                inverse[i * P + j] += L[k * P + i] * L[k * P + j];
    return 1;
}

/* The fit at its frequencies. */
static int fitted(const Layout *l, const Track *t, const Fit *f, double *work)
{
    size n = l->n, P = l->P, C = t->C;
    double *right = work;
    work += n * C;
    if (!with_signals(l, t, f, work, right))
        return FAR;
    if (!products(l, t, f, work, f->inner) || !inverted(n, P, 1e-7, f->inner, work, f->inverse))
        return NUMPY;
    times(P, C, f->inverse, right, f->coefficients);
    for (size c = 0; c < C; c++) {
        double left = f->energy[c];
        for (size i = 0; i < P; i++)
            left -= f->coefficients[i * C + c] * right[i * C + c];
        double least = ROUND_OFF * f->energy[c] + 1e-300;
        f->variance[c] = (left > least ? left : least) / (t->N > P ? t->N - P : 1);
    }
    memcpy(f->rest, right + P * C, (n - P) * C * sizeof(double));
    for (size i = P; i < n; i++)
        for (size k = 0; k < P; k++)
            for (size c = 0; c < C; c++)
                f->rest[(i - P) * C + c] -= f->inner[i * n + k] * f->coefficients[k * C + c];
    return DONE;
}

/* sinefit._newton_step: sets step and std; 0 if numpy must find directions that are not known. */
static int newton(const Layout *l, const Track *t, const Fit *f, double *work, double *neglected, double *spread)
{
    size n = l->n, P = l->P, C = t->C, S = 2 * l->S, Q = 1 + f->L;
    double *shared = work, *apart = shared + P * S, *turned = apart + S * S, *weight = turned + S * C;
    double *normal = weight + C, *right = normal + Q * Q, *covariance = right + Q;
    double bend = 0, others = 0, energy = 0, square = 0.25 * t->length * t->length;
    memset(shared, 0, P * S * sizeof(double));
    memset(normal, 0, (Q * Q + Q) * sizeof(double));
    for (size c = 0; c < C; c++)
        weight[c] = f->weight ? f->weight[c] : 1 / f->variance[c];
    for (size i = 0; i < P; i++)
        for (size k = 0; k < P; k++)
            for (size r = 0; r < S; r++)
                shared[i * S + r] += f->inverse[i * P + k] * f->inner[k * n + P + r];
    for (size r = 0; r < S; r++) {
        double share = r >= 2 * f->H ? 1 : f->free ? f->informing[r / 2] * (r / 2 + 1) : 0;
        memcpy(apart + r * S, f->inner + (P + r) * n + P, S * sizeof(double));
        for (size c = 0; c < C; c++)
            turned[r * C + c] = (r % 2 ? share : -share) * f->coefficients[(r ^ 1) * C + c];
    }
    for (size i = 0; i < P; i++)
        for (size r = 0; r < S; r++)
            for (size s = 0; s < S; s++)
                apart[r * S + s] -= f->inner[i * n + P + r] * shared[i * S + s];
    for (size r = 0; r < S; r++) {
        size q = r < 2 * f->H ? 0 : 1 + r / 2 - f->H;
        for (size c = 0; c < C; c++)
            right[q] += turned[r * C + c] * weight[c] * f->rest[r * C + c];
        for (size s = 0; s < S; s++) {
            double both = 0;
            for (size c = 0; c < C; c++)
                both += turned[r * C + c] * weight[c] * turned[s * C + c];
            normal[q * Q + (s < 2 * f->H ? 0 : 1 + s / 2 - f->H)] += apart[r * S + s] * both;
        }
    }
    for (size c = 0; c < C; c++) {
        const double *X = f->coefficients + c, *rest = f->rest + c;
        double squares = 0;
        for (size r = 2; r < 2 * f->H; r++) {
            double curved = X[r * C] * (r / 2 + 1) * (r / 2 + 1);
            squares += curved * curved;
        }
        bend -= weight[c] * (X[0] * rest[S * C] + X[C] * rest[(S + 1) * C]);
        others += weight[c] * sqrt(squares * f->variance[c] * t->N / 10) * square;
        energy += weight[c] * f->variance[c] * t->N * square / 3;
    }
    if (!f->free)
        normal[0] = 1;
    double *scale = turned, *scaled = apart; /* no longer needed */
    for (size q = 0; q < Q; q++)
        scale[q] = 1 / sqrt(normal[q * Q + q] > 1e-300 ? normal[q * Q + q] : 1e-300);
    for (size i = 0; i < Q * Q; i++)
        scaled[i] = normal[i] * scale[i / Q] * scale[i % Q];
    if (!inverted(Q, Q, 0, scaled, shared, covariance))
        return 0;
    for (size q = 0; q < Q; q++)
        if (!(covariance[q * Q + q] < 1 / (ALIKE * ALIKE)))
            return 0;
    for (size i = 0; i < Q * Q; i++)
        covariance[i] *= scale[i / Q] * scale[i % Q];
    times(Q, 1, covariance, right, f->step);
    for (size q = 0; q < Q; q++) {
        f->std[q] = sqrt(covariance[q * Q + q]);
        if (!isfinite(f->step[q]))
            return 0;
    }
    *spread = LEFT_OVER * sqrt(energy);
    *neglected = 0;
    if (!f->free) {
        f->std[0] = 0;
        return 1;
    }
    double bent = fmin(fmax(bend * covariance[0], -BENT), BENT), longer = f->step[0] * bent / (1 - bent);
    for (size q = 0; q < Q; q++)
        f->step[q] += covariance[q * Q] / covariance[0] * longer;
    *neglected = (bent * bent + LEFT_OVER * others * covariance[0]) / f->std[0];
    return 1;
}

/* Room that `work` of fp_fit needs. */
size fp_room(size n, size C, size H, size L)
{
    size sums = POWERS * (2 * H + 1 + 2 * L * (H + L + 1)) + n * n, signals = 2 * C * DRIFT * (H + L + 1) + n * C;
    return n * C + sums + signals + n * n + (2 + L) * (2 + L) * 3;
}

/* sinefit.refine of one track without missing samples: a fit, and at most `rounds` steps of its frequencies.
   It can go on after FAR, with moments at its frequencies. */
WIDE size fp_fit(const Layout *l, const Track *t, Fit *f, double *work)
{
    double bin = 2 * PI / t->length, *before = work, neglected, spread;
    work += 1 + f->L;
    int state = fitted(l, t, f, work);
    for (; f->rounds > 0 && state == DONE; f->rounds--) {
        int small = 1;
        double most = 0;
        memcpy(before, f->step, (1 + f->L) * sizeof(double));
        if (!newton(l, t, f, work, &neglected, &spread))
            return NUMPY;
        for (size q = 0; q <= f->L; q++) {
            double gap = INFINITY, leak = 1, *step = f->step + q, last = fabs(before[q] * f->std[q]);
            for (size h = 1; q > 0 && h <= f->H; h++)
                gap = fmin(gap, fabs(f->lines[q - 1] - *f->omega * h));
            if (q > 0)
                leak = fmin(LEFT_OVER * sqrt(12.0) / (t->length * gap), 1);
            small &= fabs(*step) * leak < fmax(1e-12 * bin, LEFT * f->std[q]);
            *step = fmin(fmax(*step, -LONGEST * bin), LONGEST * bin);
            double size = fabs(*step), next = size * fmin(size / fmax(last, 1e-300), spread);
            if (q == 0)
                next = size * (neglected + spread * bin / *f->omega);
            most = fmax(most, next * leak);
        }
        if (small)
            break;
        *f->omega += f->step[0];
        for (size q = 0; q < f->L; q++)
            f->lines[q] += f->step[1 + q];
        state = fitted(l, t, f, work);
        if (most < LEFT)
            f->rounds = 1;
    }
    return state;
}
