/* The part of Simulink's SimStruct interface that psdmc's S-functions call, written from its documentation for tests. */
#ifndef SIMSTRUC_H
#define SIMSTRUC_H

typedef int int_T;
typedef double real_T;
enum { SS_DOUBLE = 0, SS_SINGLE = 1 };
enum { SS_OPTION_EXCEPTION_FREE_CODE = 1 };
#define INHERITED_SAMPLE_TIME ((real_T)-1.0)

typedef struct {
    int_T width, type, contiguous, feedthrough;
    void *signal;
} port;

typedef struct {
    int_T parameters, given_parameters, inputs, outputs, continuous, discrete, sample_times, options, inherits;
    real_T sample_time, offset;
    port input[16], output[16];
    const char *error;
} SimStruct;

#define ssSetNumSFcnParams(S, n) ((S)->parameters = (n))
#define ssGetNumSFcnParams(S) ((S)->parameters)
#define ssGetSFcnParamsCount(S) ((S)->given_parameters)
#define ssSetNumInputPorts(S, n) (((S)->inputs = (n)) <= 16)
#define ssSetNumOutputPorts(S, n) (((S)->outputs = (n)) <= 16)
#define ssSetNumContStates(S, n) ((S)->continuous = (n))
#define ssSetNumDiscStates(S, n) ((S)->discrete = (n))
#define ssSetInputPortWidth(S, k, n) ((S)->input[k].width = (n))
#define ssSetInputPortDataType(S, k, t) ((S)->input[k].type = (t))
#define ssSetInputPortRequiredContiguous(S, k, yes) ((S)->input[k].contiguous = (yes))
#define ssSetInputPortDirectFeedThrough(S, k, yes) ((S)->input[k].feedthrough = (yes))
#define ssSetOutputPortWidth(S, k, n) ((S)->output[k].width = (n))
#define ssSetOutputPortDataType(S, k, t) ((S)->output[k].type = (t))
#define ssSetNumSampleTimes(S, n) ((S)->sample_times = (n))
#define ssSetOptions(S, o) ((S)->options = (o))
#define ssSetSampleTime(S, k, t) ((void)(k), (S)->sample_time = (t))
#define ssSetOffsetTime(S, k, t) ((void)(k), (S)->offset = (t))
#define ssSetModelReferenceSampleTimeDefaultInheritance(S) ((S)->inherits = 1)
#define ssGetInputPortSignal(S, k) ((const void *)(S)->input[k].signal)
#define ssGetOutputPortSignal(S, k) ((S)->output[k].signal)
#define ssSetErrorStatus(S, text) ((S)->error = (text))

#endif
