/* Stands in for the file that MATLAB includes at the end of an S-function: it calls the S-function's methods. */
static SimStruct block;

/* Widths of the input ports, then of the output ports; -1: a property of a port or of the block is not as expected. */
int start(int parameters, int *widths)
{
    int k = 0;
    block = (SimStruct){ .given_parameters = parameters };
    mdlInitializeSizes(&block);
    if (block.parameters != block.given_parameters) {
        return -1;
    }
    mdlInitializeSampleTimes(&block);
    for (int p = 0; p < block.inputs; p++) {
        if (!block.input[p].contiguous || !block.input[p].feedthrough || block.input[p].type != SS_DOUBLE) {
            return -1;
        }
        widths[k++] = block.input[p].width;
    }
    for (int p = 0; p < block.outputs; p++) {
        widths[k++] = block.output[p].width;
    }
    return block.sample_times == 1 && block.sample_time == INHERITED_SAMPLE_TIME && block.inherits ? k : -1;
}

const char *outputs(void **signals)
{
    for (int k = 0; k < block.inputs; k++) {
        block.input[k].signal = signals[k];
    }
    for (int k = 0; k < block.outputs; k++) {
        block.output[k].signal = signals[block.inputs + k];
    }
    mdlOutputs(&block, 0);
    mdlTerminate(&block);
    return block.error;
}
