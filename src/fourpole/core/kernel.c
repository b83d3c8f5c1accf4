/* What kernel.py hands over: decimals of a table of text, and the fit of sines to a track. The same as in numpy, which
   remains where there is no compiler, and wherever a function here says so. C99, without Python.h.
   Arrays are contiguous, of double, of complex double, or of int64_t; kernel.py sees to that. */

#include <complex.h>
#include <float.h>
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
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
/* As in sums.py and sinefit.py; the last is the least share of the samples that a row must have for itself. */
static const double PI = 3.14159265358979323846, FEWEST = 0.5, NEAR = 0.15, ROUND_OFF = 1e-14, ALIKE = 1e-3;
static const double LEFT = 1e-3, LEFT_OVER = 3, BENT = 0.3, LONGEST = 0.3, INDEPENDENT = 1e-9;
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

/* sinefit.SineFit of H harmonics and L lines, with at most `rounds` steps; `step` (1 + L) is the last of them. What is
   found stands one after the other, from `omega` on; its parts are known by their sizes. */
typedef struct {
    size H, L, rounds, free;
    const double *energy, *informing, *weight;
    double *omega, *lines, *step, *std, *inner, *inverse, *coefficients, *rest, *variance;
} Fit;

/* out (m, n) = (rows (n, n) times a table (n, m))', for rows that are nearly diagonal. */
static void times(size n, size m, const double *rows, const double *table, double *out)
{
    memset(out, 0, n * m * sizeof(double));
    for (size i = 0; i < n; i++)
        for (size k = 0; k < n; k++)
            for (size j = 0; j < m && rows[i * n + k] != 0; j++)
                out[j * n + i] += rows[i * n + k] * table[k * m + j];
}

/* Gauss-Jordan elimination of the first P of n rows and m >= n columns: in place of A and B beside it, inverse(A) and
   inverse(A) B; what is left of the other rows. 0 if a pivot is not above the least. */
static int eliminated(size n, size m, size P, double least, double *a)
{
    for (size k = 0; k < P; k++) {
        double *row = a + k * m, pivot = row[k];
        if (!(pivot > least))
            return 0;
        row[k] = 1;
        for (size j = 0; j < m; j++)
            row[j] /= pivot;
        for (size i = 0; i < n; i++) {
            double share = i == k ? 0 : a[i * m + k];
            a[i * m + k] = i == k ? row[k] : 0;
            for (size j = 0; j < m; j++)
                a[i * m + j] -= share * row[j];
        }
    }
    return 1;
}

/* sums_without_samples at one frequency, at steps of `stride`; 0 if it is so low that there is no closed form. */
static int closed(const Track *t, double frequency, double *sums, size stride)
{
    double x = frequency / (2 * t->rate), sine = sin(x), N = (double)t->N, powers[POWERS] = {1 / sine};
    double step = cos(x) / sine / (N - 1), many = sin(N * x), few = cos(N * x);
    if (frequency != 0 && fabs(sine) * N < FEWEST)
        return 0;
    for (size p = 0; p < POWERS; p++) {
        double s = 0, c = 0;
        powers[p] = p ? powers[p - 1] * step : powers[0];
        for (size q = 0; q <= p; q++) {
            s += t->by_sine[p * POWERS + q] * powers[q];
            c += t->by_cosine[p * POWERS + q] * powers[q];
        }
        sums[p * stride] = frequency != 0 ? many * s + few * c : t->still[p];
    }
    return 1;
}

/* Inner products (n, n) of the rows; 0 if they are left to numpy. */
static int products(const Layout *l, const Track *t, const Fit *f, double *sums)
{
    size n = l->n, K = 0, still = 2 * f->H + 1, others = f->H + f->L + 1, count = still + 2 * f->L * others;
    double *flat = sums + POWERS * count, half = t->half, scale[] = {1, half, half * half, pow(half, 3), pow(half, 4)};
    int known = 1;
    for (; K < still; K++) /* Terms.differences */
        known &= closed(t, *f->omega * K, sums + K, count);
    for (size k = 0; k < 2 * f->L; k++)
        for (size i = 0; i < others; i++, K++) {
            double other = i <= f->H ? *f->omega * i : f->lines[i - f->H - 1], line = f->lines[k / 2];
            known &= closed(t, k % 2 ? other - line : other + line, sums + K, count);
        }
    for (size i = 0; i < n * n; i++)
        f->inner[i] = l->of_below[i] * sums[l->below[i]] + l->of_above[i] * sums[l->above[i]];
    times(n, n, l->rows, f->inner, flat);
    times(n, n, l->rows, flat, f->inner);
    for (size i = 0; i < n; i++)
        for (size j = 0; j < n; j++)
            f->inner[i * n + j] *= scale[l->seconds[i] + l->seconds[j]];
    return known;
}

/* Inner products (C, n) of the rows with the channels, from the moments at the nearest frequency; 0 if none is near. */
static int with_signals(const Layout *l, const Track *t, const Fit *f, double *work, double *right)
{
    size C = t->C, n = l->n, sines = l->S + 1;
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
        for (size i = 0; i < 3 * C; i++) {
            const double complex *x = t->moments + i * SERIES * t->bases + near;
            double complex share = 1, sum = 0;
            for (size e = 0; e < SERIES; share *= -I * turn / (double)++e, x += t->bases)
                sum += share * *x;
            sums[(i / 3 * DRIFT + i % 3) * sines + s] = sum;
        }
    }
    for (size i = 0; i < C * DRIFT; i++)
        sums[i * sines + l->S] = t->drift[i];
    for (size i = 0; i < n * C; i++) {
        size row = l->kept[i / C], atom = row / 2;
        double complex sum = sums[(i % C * DRIFT + l->power[atom]) * sines + l->frequency[atom]];
        flat[i] = row % 2 ? cimag(sum) : creal(sum);
    }
    times(n, C, l->rows, flat, right);
    for (size i = 0; i < n * C; i++)
        for (size p = 0; p < l->seconds[i % n]; p++)
            right[i] *= t->half;
    return 1;
}

/* The fit at its frequencies; in `whole` (n, n + C), the other rows have less what those fitted explain. */
static int fitted(const Layout *l, const Track *t, const Fit *f, double *whole)
{
    size n = l->n, P = l->P, C = t->C, m = n + C;
    double *right = whole + n * m, *work = right + n * C;
    if (!with_signals(l, t, f, work, right))
        return FAR;
    if (!products(l, t, f, work))
        return NUMPY;
    for (size i = 0; i < n; i++)
        for (size j = 0; j < m; j++)
            whole[i * m + j] = j < n ? f->inner[i * n + j] : right[(j - n) * n + i];
    if (!eliminated(n, m, P, INDEPENDENT * t->N, whole))
        return NUMPY;
    for (size i = 0; i < P * P; i++)
        f->inverse[i] = whole[i / P * m + i % P];
    memcpy(f->variance, f->energy, C * sizeof(double));
    for (size i = 0; i < n * C; i++) {
        double left = whole[i / C * m + n + i % C];
        *(i < P * C ? f->coefficients + i : f->rest + i - P * C) = left;
        f->variance[i % C] -= i < P * C ? left * right[i % C * n + i / C] : 0;
    }
    for (size c = 0; c < C; c++)
        f->variance[c] = fmax(f->variance[c], ROUND_OFF * f->energy[c] + 1e-300) / (t->N > P ? t->N - P : 1);
    return DONE;
}

/* sinefit._newton_step: sets step and std; 0 if numpy must find directions that are not known. */
static int newton(const Layout *l, const Track *t, const Fit *f, double *whole, double *neglected, double *spread)
{
    size n = l->n, P = l->P, C = t->C, S = 2 * l->S, Q = 1 + f->L, m = Q + 1;
    double *turned = whole + n * (n + C), *weight = turned + S * C, *scale = weight + C, *normal = scale + Q;
    double bend = 0, others = 0, energy = 0, square = 0.25 * t->length * t->length;
    memset(normal, 0, Q * m * sizeof(double)); /* with the right side beside it */
    for (size c = 0; c < C; c++) {
        double squares = 0, w = weight[c] = f->weight ? f->weight[c] : 1 / f->variance[c];
        for (size r = 0; r < S; r++) {
            double share = r >= 2 * f->H ? 1 : f->free ? f->informing[r / 2] * (r / 2 + 1) : 0;
            double order = r > 1 && r < 2 * f->H ? (double)(r / 2 + 1) : 0;
            double bent = f->coefficients[r * C + c] * order * order;
            turned[r * C + c] = (r % 2 ? share : -share) * f->coefficients[(r ^ 1) * C + c];
            normal[(r < 2 * f->H ? 0 : 1 + r / 2 - f->H) * m + Q] += turned[r * C + c] * w * f->rest[r * C + c];
            squares += bent * bent;
        }
        bend -= w * (f->coefficients[c] * f->rest[S * C + c] + f->coefficients[C + c] * f->rest[(S + 1) * C + c]);
        others += w * sqrt(squares * f->variance[c] * t->N / 10) * square;
        energy += w * f->variance[c] * t->N * square / 3;
    }
    for (size r = 0; r < S; r++)
        for (size s = 0; s < S; s++) {
            size q = r < 2 * f->H ? 0 : 1 + r / 2 - f->H, p = s < 2 * f->H ? 0 : 1 + s / 2 - f->H;
            double both = 0;
            for (size c = 0; c < C; c++)
                both += turned[r * C + c] * weight[c] * turned[s * C + c];
            normal[q * m + p] += whole[(P + r) * (n + C) + P + s] * both;
        }
    if (!f->free)
        normal[0] = 1;
    for (size q = 0; q < Q; q++)
        scale[q] = 1 / sqrt(fmax(normal[q * m + q], 1e-300));
    for (size i = 0; i < Q * m; i++)
        normal[i] *= scale[i / m] * (i % m < Q ? scale[i % m] : 1);
    int known = eliminated(Q, m, Q, 0, normal);
    for (size q = 0; q < Q; q++) {
        f->step[q] = normal[q * m + Q] * scale[q];
        f->std[q] = sqrt(normal[q * m + q]) * scale[q];
        known &= isfinite(f->step[q]) && normal[q * m + q] < 1 / (ALIKE * ALIKE);
    }
    double variance = f->std[0] * f->std[0], bent = fmin(fmax(bend * variance, -BENT), BENT);
    double longer = f->step[0] * bent / (1 - bent) / (normal[0] * scale[0]);
    for (size q = 0; q < Q && f->free; q++)
        f->step[q] += normal[q * m] * scale[q] * longer;
    *spread = LEFT_OVER * sqrt(energy);
    *neglected = f->free ? (bent * bent + LEFT_OVER * others * variance) / f->std[0] : 0;
    f->std[0] *= f->free;
    return known;
}

/* sinefit.refine of one track without missing samples: a fit, and at most `rounds` steps of its frequencies.
   It can go on after FAR, with moments at its frequencies. */
WIDE size fp_fit(const Layout *l, const Track *t, Fit *f)
{
    size n = l->n, C = t->C, L = f->L, count = 2 * f->H + 1 + 2 * L * (f->H + L + 1);
    size room = 2 * n * (n + C) + POWERS * count + 2 * C * (DRIFT + 1) * (n + 1) + (L + 2) * (L + 3);
    f->lines = f->omega + 1;
    f->step = f->lines + L;
    f->std = f->step + 1 + L;
    f->inner = f->std + 1 + L;
    f->inverse = f->inner + n * n;
    f->coefficients = f->inverse + l->P * l->P;
    f->rest = f->coefficients + l->P * C;
    f->variance = f->rest + (n - l->P) * C;
    double bin = 2 * PI / t->length, neglected, spread, *before = malloc((1 + L + room) * sizeof(double));
    double *whole = before + 1 + L;
    int state = before ? fitted(l, t, f, whole) : NUMPY;
    for (; f->rounds > 0 && state == DONE; f->rounds--) {
        int small = 1;
        double most = 0;
        memcpy(before, f->step, (1 + L) * sizeof(double));
        if (!newton(l, t, f, whole, &neglected, &spread)) {
            state = NUMPY;
            break;
        }
        for (size q = 0; q <= L; q++) {
            double gap = INFINITY, *step = f->step + q, last = fabs(before[q] * f->std[q]);
            for (size h = 1; q > 0 && h <= f->H; h++)
                gap = fmin(gap, fabs(f->lines[q - 1] - *f->omega * h));
            double leak = q > 0 ? fmin(LEFT_OVER * sqrt(12.0) / (t->length * gap), 1) : 1;
            small &= fabs(*step) * leak < fmax(1e-12 * bin, LEFT * f->std[q]);
            *step = fmin(fmax(*step, -LONGEST * bin), LONGEST * bin);
            double rest = q ? fmin(fabs(*step) / fmax(last, 1e-300), spread) : neglected + spread * bin / *f->omega;
            most = fmax(most, fabs(*step) * rest * leak);
        }
        if (small)
            break;
        for (size q = 0; q <= L; q++)
            *(q ? f->lines + q - 1 : f->omega) += f->step[q];
        state = fitted(l, t, f, whole);
        if (most < LEFT)
            f->rounds = 1;
    }
    free(before);
    return state;
}
