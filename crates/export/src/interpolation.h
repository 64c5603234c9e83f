
/* Linear interpolation in a table of at least two entries at index place; constant beyond either end. */
HB_MAYBE_UNUSED static HB_REAL hb_interpolated(const HB_REAL *table, int count, HB_REAL place)
{
    const HB_REAL last = (HB_REAL)(count - 1);
    const HB_REAL from = (place < (HB_REAL)0) ? (HB_REAL)0 : place;
    const HB_REAL at = (last < from) ? last : from;
    /* NaN selects the first entry; its weight is NaN, and so is the result */
    const int whole = (at == at) ? (int)at : 0;
    const int first = (whole < count - 2) ? whole : count - 2;
    const HB_REAL before = at - (HB_REAL)first;
    const HB_REAL behind = at - (HB_REAL)(first + 1);
    const HB_REAL left = (HB_REAL)1 - ((before < (HB_REAL)0) ? -before : before);
    const HB_REAL right = (HB_REAL)1 - ((behind < (HB_REAL)0) ? -behind : behind);
    const HB_REAL sum = HB_FMA(table[first], (left < (HB_REAL)0) ? (HB_REAL)0 : left, (HB_REAL)0);
    return HB_FMA(table[first + 1], (right < (HB_REAL)0) ? (HB_REAL)0 : right, sum);
}
