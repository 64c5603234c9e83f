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

/* Sine and cosine turned by the number of quarters in the last bits. */
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
