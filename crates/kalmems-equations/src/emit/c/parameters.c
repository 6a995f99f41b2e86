
/* CRC-32 as Ethernet and zip files have it, of all that stands before it. */
static uint32_t sum_of(const @name@_parameters_t *parameters)
{
    const unsigned char *bytes = (const unsigned char *)parameters;
    const unsigned char *const end = (const unsigned char *)&parameters->crc;
    uint32_t crc = 0xFFFFFFFFU;
    unsigned bit;
    for (; bytes < end; bytes++) {
        crc ^= *bytes;
        for (bit = 0U; bit < 8U; bit++) {
            crc = (crc >> 1) ^ ((crc & 1U) != 0U ? 0xEDB88320U : 0U);
        }
    }
    return ~crc;
}

void @name@_seal_parameters(@name@_parameters_t *parameters)
{
    parameters->version = @NAME@_PARAMETERS_VERSION;
    parameters->experiment = @NAME@_EXPERIMENT;
    parameters->crc = sum_of(parameters);
}

int @name@_parameters_are_whole(const @name@_parameters_t *parameters)
{
    return parameters->version == @NAME@_PARAMETERS_VERSION && parameters->experiment == @NAME@_EXPERIMENT
           && parameters->crc == sum_of(parameters);
}
