/* Sine and cosine of an angle [rad]. */
typedef struct {
    hb_real sine;
    hb_real cosine;
} hb_turn;

HB_MAYBE_UNUSED static uint64_t hb_bits(double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

HB_MAYBE_UNUSED static double hb_double(uint64_t bits)
{
    double value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

/* Two to the power of the integer in the last bits. */
HB_MAYBE_UNUSED static double hb_power_of_two(double held)
{
    return hb_double((hb_bits(held) + UINT64_C(1023)) << 52);
}

/* Sine and cosine, rotated by the number of quarter turns in the last bits. */
HB_MAYBE_UNUSED static double hb_turned_sine(double held, double sine, double cosine)
{
    const uint64_t quarters = hb_bits(held);
    const uint64_t turned = ((quarters & 1U) != 0U) ? hb_bits(cosine) : hb_bits(sine);
    return hb_double(turned ^ ((quarters & 2U) << 62));
}

HB_MAYBE_UNUSED static double hb_turned_cosine(double held, double sine, double cosine)
{
    const uint64_t quarters = hb_bits(held);
    const uint64_t turned = ((quarters & 1U) != 0U) ? hb_bits(sine) : hb_bits(cosine);
    return hb_double(turned ^ (((quarters + 1U) & 2U) << 62));
}

/* value = mantissa 2^exponent, the mantissa in sqrt(1/2) .. sqrt(2). */
HB_MAYBE_UNUSED static double hb_exponent(double value)
{
    const uint64_t shifted = hb_bits(value) - UINT64_C(0x3fe6a09e667f3bcd);
    const uint64_t field = shifted >> 52;
    return (field >= 2048U) ? ((double)field - 4096.0) : (double)field;
}

HB_MAYBE_UNUSED static double hb_mantissa(double value)
{
    const uint64_t bits = hb_bits(value);
    const uint64_t field = (bits - UINT64_C(0x3fe6a09e667f3bcd)) >> 52;
    const double mantissa = hb_double(bits - (field << 52));
    return ((value > 0.0) && (value < HB_INFINITY)) ? mantissa : HB_NAN;
}

#if defined(HB_SOFT_FMA)
/* a b + c, rounded once, for libraries whose fma rounds twice: exact product and sums with their errors, the last but
   one sum rounded to odd (Boldo and Melquiond, doi:10.1109/TC.2007.70819). Valid without overflow and underflow. */
HB_MAYBE_UNUSED static double hb_fma(double a, double b, double c)
{
    const double split = 134217729.0; /* 2^27 + 1 */
    const double product = a * b;
    const double a_long = a * split;
    const double a_high = a_long - (a_long - a);
    const double a_low = a - a_high;
    const double b_long = b * split;
    const double b_high = b_long - (b_long - b);
    const double b_low = b - b_high;
    const double product_rest =
        (((a_high * b_high - product) + a_high * b_low) + a_low * b_high) + a_low * b_low;
    const double small = c + product_rest;
    const double small_part = small - c;
    const double small_rest = (c - (small - small_part)) + (product_rest - small_part);
    const double sum = product + small;
    const double sum_part = sum - product;
    const double sum_rest = (product - (sum - sum_part)) + (small - sum_part);
    double odd = small_rest + sum_rest;
    const double odd_part = odd - small_rest;
    const double left = (small_rest - (odd - odd_part)) + (sum_rest - odd_part);
    if (!(product - product < 1.0) || !(c - c < 1.0)) {
        return product + c;
    }
    if ((left != 0.0) && ((hb_bits(odd) & 1U) == 0U)) {
        const uint64_t away = ((left > 0.0) == (odd > 0.0)) ? UINT64_C(1) : ~UINT64_C(0);
        odd = hb_double(hb_bits(odd) + away);
    }
    return sum + odd;
}
#define HB_FMA hb_fma
#else
#define HB_FMA fma
#endif
